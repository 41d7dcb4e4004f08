"""Pictures of every state of the page, to be looked at:

python -m tests.app.page.look FOLDER [--scenes lifted,question] [--sizes phone,desk] [--schemes light,dark]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import get_args

from tests.app.page.browsers import SIZES, Scheme, Visitor, chromium
from tests.app.page.scenes import SCENES
from tests.app.page.stage import Stage

SETTLED = 250.0
"""After so long a page has taken another size on [ms, wall]."""


def main() -> None:
    """Take them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--sizes", default=",".join(SIZES))
    parser.add_argument("--schemes", default=",".join(get_args(Scheme)))
    wishes = parser.parse_args()
    wishes.folder.mkdir(parents=True, exist_ok=True)
    with chromium() as browser:
        for name in wishes.scenes.split(","):
            scene, fen = SCENES[name]
            with tempfile.TemporaryDirectory() as records, Stage(Path(records), fen) as stage:
                visitor = Visitor(browser, stage.address)
                scene(stage, visitor)
                for size in wishes.sizes.split(","):
                    width, height = SIZES[size]
                    visitor.page.set_viewport_size({"width": width, "height": height})
                    for scheme in wishes.schemes.split(","):
                        visitor.page.emulate_media(color_scheme=scheme)
                        visitor.page.wait_for_timeout(SETTLED)
                        visitor.page.screenshot(path=wishes.folder / f"{name}-{size}-{scheme}.png")
                visitor.close()
            print(name)


if __name__ == "__main__":
    main()
