"""Serves Open Image Denoise (the package mitsuba-oidn, which has the library and its weights) to noisefloor-denoise.

Pictures: "radiance", linear and not negative; optionally "albedo" in [0, 1], and with it "normal" in [-1, 1]. Runs on the CPU,
always with as many threads: the last bits of its results depend on their number. Processors with other instructions may round
otherwise, too.
"""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import host

# More do not change the result: 3, 4 and 8 agree to the bit
THREADS = 4


class Oidn:
    def __init__(self, init):
        import mitsuba_oidn
        import numpy

        self.oidn, self.np = mitsuba_oidn, numpy
        self.device = mitsuba_oidn.Device(mitsuba_oidn.DeviceType.CPU)
        self.device.num_threads = THREADS
        self.device.commit()
        self.info = {"name": f"Open Image Denoise {self.device.version}"}

    def filter(self, width, height, pictures):
        def array(name):
            if name not in pictures:
                return None
            return self.np.frombuffer(pictures[name], "<f4").reshape(height, width, 3).astype(self.np.float32)

        # Radiance is never negative; rounding may make it so
        radiance = self.np.maximum(array("radiance"), 0.0)
        made = self.oidn.denoise(radiance, array("albedo"), array("normal"), hdr=True, device=self.device)
        return self.np.ascontiguousarray(made, self.np.float32)


if __name__ == "__main__":
    host.serve(Oidn)
