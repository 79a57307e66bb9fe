"""Serves Open Image Denoise (the package mitsuba-oidn, which has the library and its weights) to noisefloor-denoise.

Pictures: "radiance", linear and not negative, scaled so that the network sees it as it is; optionally "albedo" in [0, 1], and
with it "normal" in [-1, 1], or "clean albedo" and "clean normal", which have no noise. "albedo" or "normal" alone is denoised
itself. Runs on the CPU unless init["device"] says otherwise, with a number of threads that depends on the size of the picture
alone: the last bits of its results depend on it. Processors with other instructions may round otherwise, and GPUs do.
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
        warnings = []
        self.gpu = host.pick(init.get("device"), self.gpus, warnings, self.device)
        name = f"Open Image Denoise {mitsuba_oidn.Device(mitsuba_oidn.DeviceType.CPU).version}"
        self.info = {"name": f"{name} ({self.gpu[1]}, {self.gpu[0]})" if self.gpu else name, "warnings": warnings}

    @staticmethod
    def gpus():
        import mitsuba_oidn

        found = [each for each in mitsuba_oidn.physical_devices() if each.type != mitsuba_oidn.DeviceType.CPU]
        return [(each.type.name, each.name, each.id) for each in found], "Open Image Denoise finds none that it knows"

    def device(self, gpu):
        """A device that is ready."""
        device = self.oidn.Device.from_physical(gpu[2])
        device.commit()
        return device

    def filter(self, width, height, frames):
        if self.gpu:
            return [self.staged(width, height, frame) for frame in frames]
        small = width * height <= SMALL
        # One filter for each frame at work: it is busy meanwhile
        slots = range(len(frames)) if small else [0] * len(frames)
        run = self.pool.map if small else map
        return list(run(lambda slot, frame: self.one(slot, width, height, frame), slots, frames))

    def pictures(self, width, height, frame):
        """The pictures of a frame, by the names that the filter has for them."""
        for name, data in frame.items():
            picture = self.np.frombuffer(data, "<f4").reshape(height, width, 3).astype(self.np.float32)
            if name == "radiance":
                # It is never negative; rounding may make it so
                yield "color", self.np.maximum(picture, 0.0)
            else:
                yield name.removeprefix(CLEAN), picture

    def one(self, slot, width, height, frame):
        made = self.np.empty((height, width, 3), self.np.float32)
        filter = self.filter_for(slot, (width, height), tuple(frame))
        for name, picture in self.pictures(width, height, frame):
            filter.set_image(name, picture)
        filter.set_image("output", made)
        filter.execute()
        return made

    def staged(self, width, height, frame):
        """One picture, by way of a device's own memory."""
        what = (width, height), tuple(frame)
        last, device, filter, buffers = self.filters.get("staged", (None, None, None, {}))
        made, pictures = self.np.empty((height, width, 3), self.np.float32), dict(self.pictures(width, height, frame))
        if last != what:
            device, buffers = device or self.device(self.gpu), {}
            filter = self.settle(device.new_filter("RT"), tuple(frame))
            for name in [*pictures, "output"]:
                buffers[name] = device.new_buffer(made.nbytes)
                filter.set_image(name, buffers[name], format=self.oidn.Format.Float3, width=width, height=height)
            self.filters["staged"] = what, device, filter, buffers
        for name, picture in pictures.items():
            buffers[name].write(picture)
        filter.execute()
        buffers["output"].read(made)
        return made

    def settle(self, filter, names):
        """Of pictures of these names, in the best quality."""
        filter.quality = self.oidn.Quality.High
        if "radiance" in names:
            filter.hdr, filter.input_scale = True, 1.0
        filter.clean_aux = any(name.startswith(CLEAN) for name in names)
        return filter

    def filter_for(self, slot, size, names):
        """The filter of a slot, as it was for the last picture if that was alike: it reads its weights only once."""
        last, filter = self.filters.get(slot, (None, None))
        if last != (size, names):
            device = self.oidn.Device(self.oidn.DeviceType.CPU)
            device.num_threads = 1 if size[0] * size[1] <= SMALL else THREADS
            # Threads that are bound to cores would share them with those of the other frame
            device.set_bool("setAffinity", False)
            device.commit()
            filter = self.settle(device.new_filter("RT"), names)
            self.filters[slot] = (size, names), filter
        return filter


if __name__ == "__main__":
    host.serve(Oidn)
