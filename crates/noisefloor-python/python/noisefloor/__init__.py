"""Tells progressive renderers, tile by tile, when people stop seeing noise.

A renderer pushes samples into a Session, which names the tiles that need more and says when each is done:

    import noisefloor

    session = noisefloor.Session(width, height)
    while not session.done:
        for request in session.requests():
            session.push(request.tile, request.spp, render(request))   # float32, (height, width, 3)
        session.judge()
    picture = session.image()

check() tries a renderer before that, judge() judges finished pictures, metrics() compares two, and read()
and write() know EXR and PNG files. Search finds a renderer's own noise threshold, or its samples, at which
nobody sees noise. Pictures are arrays of shape (height, width, 3) with linear radiance,
Rec. 709 primaries. C-contiguous float32 arrays are read where they lie; others are converted. Requests can
be pickled, so that other processes can render. Every error is a noisefloor.Error.
"""

from ._noisefloor import *
from ._noisefloor import __version__

__all__ = [name for name in dir() if not name.startswith("_")]
