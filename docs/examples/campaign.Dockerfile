# Environment of a campaign's workers and scheduler; build it in the repository of the commit that runs the campaign:
#   docker build -f docs/examples/campaign.Dockerfile -t touchmove-campaign .
FROM python:3.11-slim-bookworm
RUN apt-get update && apt-get install -y --no-install-recommends stockfish libegl1 libgl1-mesa-dri libusb-1.0-0 \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /touchmove
COPY . .
RUN pip install --no-cache-dir -c constraints.txt setuptools \
    && pip install --no-cache-dir --no-build-isolation -c constraints.txt -e '.[campaign]'
ENV OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# scheduler: dask scheduler    worker: dask worker tcp://scheduler:8786 --nthreads 1
CMD ["dask", "scheduler"]
