"""LeRobot's dataset format v3.0, written with pyarrow and PyAV.

Source: huggingface/lerobot at 7427f31 (23 Aug 2026), ``src/lerobot/datasets`` and ``src/lerobot/configs/video.py``.
"""
