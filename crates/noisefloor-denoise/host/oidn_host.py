"""Serves Open Image Denoise (the package mitsuba-oidn, which has the library and its weights) to noisefloor-denoise.

Pictures: "radiance", linear and not negative, scaled so that the network sees it as it is; optionally "albedo" in [0, 1], and
with it "normal" in [-1, 1], or "clean albedo" and "clean normal", which have no noise. "albedo" or "normal" alone is denoised
itself. Runs on the CPU, with a number of threads that depends on the size of the picture alone: the last bits of its results
depend on it. Processors with other instructions may round otherwise, too.
"""

import os
import sys
from concurrent.futures import ThreadPoolExecutor

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import host

# In small pictures, threads wait for each other more than they compute: there, frames are denoised at once, by one thread each
SMALL = 512 * 512
THREADS = 4
CLEAN = "clean "


class Oidn:
    def __init__(self, init):
        import mitsuba_oidn
        import numpy

        self.oidn, self.np = mitsuba_oidn, numpy
        self.filters = {}
        self.pool = ThreadPoolExecutor(2)
        self.info = {"name": f"Open Image Denoise {mitsuba_oidn.Device(mitsuba_oidn.DeviceType.CPU).version}"}

    def filter(self, width, height, frames):
        small = width * height <= SMALL
        # One filter for each frame at work: it is busy meanwhile
        slots = range(len(frames)) if small else [0] * len(frames)
        run = self.pool.map if small else map
        return list(run(lambda slot, frame: self.one(slot, width, height, frame), slots, frames))

    def one(self, slot, width, height, frame):
        def array(name):
            return self.np.frombuffer(frame[name], "<f4").reshape(height, width, 3).astype(self.np.float32)

        made = self.np.empty((height, width, 3), self.np.float32)
        filter = self.filter_for(slot, (width, height), tuple(frame))
        for name in frame:
            if name == "radiance":
                # It is never negative; rounding may make it so
                filter.set_image("color", self.np.maximum(array(name), 0.0))
            else:
                filter.set_image(name.removeprefix(CLEAN), array(name))
        filter.set_image("output", made)
        filter.execute()
        return made

    def filter_for(self, slot, size, names):
        """The filter of a slot, as it was for the last picture if that was alike: it reads its weights only once."""
        last, filter = self.filters.get(slot, (None, None))
        if last != (size, names):
            device = self.oidn.Device(self.oidn.DeviceType.CPU)
            device.num_threads = 1 if size[0] * size[1] <= SMALL else THREADS
            # Threads that are bound to cores would share them with those of the other frame
            device.set_bool("setAffinity", False)
            device.commit()
            filter = device.new_filter("RT")
            filter.quality = self.oidn.Quality.High
            if "radiance" in names:
                filter.hdr, filter.input_scale = True, 1.0
            filter.clean_aux = any(name.startswith(CLEAN) for name in names)
            self.filters[slot] = (size, names), filter
        return filter


if __name__ == "__main__":
    host.serve(Oidn)
