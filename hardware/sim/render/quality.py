"""How good a picture has to be: each use asks for what it needs, as pictures cost what is asked for."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from hardware.frozen import Frozen
from hardware.sim.render.shaders import MOST_SHADOWS


class PictureQuality(Frozen):
    """Of one colour picture, before a sensor adds its own errors."""

    samples: Annotated[int, Field(ge=0, le=8)]
    """Of each pixel, for smooth edges; 0: none. 4 cost as much as all the rest of a picture."""
    shadow_side: Annotated[int, Field(ge=0, le=8192)]
    """Of the picture that a lamp has of what it shines on [px]; 0: nothing throws shadows."""
    lamps: Annotated[int, Field(ge=1)] = MOST_SHADOWS
    """So many lamps throw shadows; where there are more, as the four that a window is made of, these shine for all."""
    coarse: bool = False
    """Shapes have fewer corners where they have simpler ones, as pieces do."""


LOOK: Final = PictureQuality(samples=4, shadow_side=2048)
"""What is looked at, by vision or by a reader of the docs: smooth edges, shadows as fine as 0.7 mm."""
FILM: Final = PictureQuality(samples=0, shadow_side=1024, lamps=2, coarse=True)
"""What passes by: edges in steps, shadows as fine as 1.5 mm and less soft, pieces of a third of the triangles."""
GLARE: Final = PictureQuality(samples=0, shadow_side=2048)
"""What nobody sees: it tells where it is so bright that depth fails."""
