"""The finished picture through Open Image Denoise, the library that Blender has beside it for Cycles.

Cycles can only denoise its own buffers, which hold the last batch. The C interface is that of OIDN 1.4 to
2.x; of 1.4, only the processor computes.
"""

import ctypes
import glob
import os

import bpy
import numpy

CPU, FLOAT3 = 1, 3
# What denoises where Cycles computes on this
GPUS = {"ONEAPI": 2, "CUDA": 3, "OPTIX": 3, "HIP": 4, "METAL": 5}


def library():
    """Path of the library; None if this Blender has none, as Debian's."""
    root = os.path.dirname(bpy.utils.resource_path("LOCAL"))
    places = [
        "lib/libOpenImageDenoise.so*",
        "lib/libOpenImageDenoise*.dylib",
        "blender.shared/OpenImageDenoise.dll",
    ]
    found = (path for place in places for path in sorted(glob.glob(os.path.join(root, place))))
    return next(found, None)


def device(scene, path):
    """What denoises as the scene says, for `denoise`: a GPU, if Cycles computes on one and is told to denoise there, and if
    Open Image Denoise can use it; else the processor. And why not, in a line, or None."""
    wanted = getattr(scene.cycles, "denoising_use_gpu", False) and gpu(scene)
    if not wanted:
        return CPU, None
    kind = GPUS.get(wanted, CPU)
    try:
        if kind == CPU:
            raise RuntimeError(f"it does not know {wanted}")
        _Device(path, kind)
        return kind, None
    except RuntimeError as error:
        return CPU, f"the processor denoises: {error}"


def gpu(scene):
    """The kind of the GPU that renders, such as CUDA; None if the processor does."""
    own = bpy.context.preferences.addons.get("cycles")
    if scene.cycles.device != "GPU" or own is None:
        return None
    kind = own.preferences.compute_device_type
    return kind if kind != "NONE" and any(each.use and each.type == kind for each in own.preferences.devices) else None


def denoise(path, colour, albedo=None, normal=None, kind=CPU):
    """colour, albedo, normal: float32 of shape (height, width, 3). Albedo and normals are denoised first, as
    Cycles does. kind: as `device` says.

    Raises RuntimeError with what OIDN says."""
    made = _Device(path, kind)
    guides = {
        name: picture
        for name, picture in [("albedo", albedo), ("normal", normal)]
        if picture is not None
    }
    guides = {name: made.run({name: picture}, name, []) for name, picture in guides.items()}
    return made.run({"color": colour, **guides}, "color", ["hdr", *(["cleanAux"] if guides else [])])


class _Device:
    """One that is ready. GPUs are kept: they take long to wake up."""

    kept = {}

    def __init__(self, path, kind):
        self.oidn, self.kind = ctypes.CDLL(path), kind
        for name in ["oidnNewDevice", "oidnNewFilter", "oidnNewBuffer"]:
            getattr(self.oidn, name).restype = ctypes.c_void_p
        self.oidn.oidnGetDeviceError.restype = ctypes.c_int
        if kind in self.kept:
            self.handle = self.kept[kind]
            return
        if kind != CPU and not hasattr(self.oidn, "oidnWriteBuffer"):
            raise RuntimeError("Open Image Denoise before 2.0 knows no GPUs")
        self.handle = ctypes.c_void_p(self.oidn.oidnNewDevice(kind))
        if not self.handle:
            self.check(None)
            raise RuntimeError("Open Image Denoise cannot use this GPU")
        self.oidn.oidnCommitDevice(self.handle)
        self.check(self.handle)
        if kind != CPU:
            self.kept[kind] = self.handle

    def __del__(self):
        if self.kind == CPU and getattr(self, "handle", None):
            self.oidn.oidnReleaseDevice(self.handle)

    def check(self, handle):
        message = ctypes.c_char_p()
        if self.oidn.oidnGetDeviceError(handle, ctypes.byref(message)) != 0:
            said = (message.value or b"an error").decode(errors="replace")
            raise RuntimeError(f"Open Image Denoise: {said}")

    def run(self, pictures, result, flags, shared=None):
        """shared: whether the device reads this process' memory, as every one of the processor does; others have their own."""
        shared = self.kind == CPU if shared is None else shared
        oidn, filtered = self.oidn, ctypes.c_void_p(self.oidn.oidnNewFilter(self.handle, b"RT"))
        pictures = {name: numpy.ascontiguousarray(picture, numpy.float32) for name, picture in pictures.items()}
        pictures["output"] = numpy.empty_like(pictures[result])
        height, width = pictures["output"].shape[:2]
        layout = [ctypes.c_size_t(number) for number in (width, height, 0, 0, 0)]
        buffers = {}
        try:
            for name, picture in pictures.items():
                data, size = ctypes.c_void_p(picture.ctypes.data), ctypes.c_size_t(picture.nbytes)
                if shared:
                    oidn.oidnSetSharedFilterImage(filtered, name.encode(), data, FLOAT3, *layout)
                    continue
                buffers[name] = ctypes.c_void_p(oidn.oidnNewBuffer(self.handle, size))
                self.check(self.handle)
                if name != "output":
                    oidn.oidnWriteBuffer(buffers[name], ctypes.c_size_t(0), size, data)
                oidn.oidnSetFilterImage(filtered, name.encode(), buffers[name], FLOAT3, *layout)
            set_flag = getattr(oidn, "oidnSetFilterBool", None) or oidn.oidnSetFilter1b
            for flag in flags:
                set_flag(filtered, flag.encode(), ctypes.c_bool(True))
            oidn.oidnCommitFilter(filtered)
            oidn.oidnExecuteFilter(filtered)
            if not shared:
                made = pictures["output"]
                data, size = ctypes.c_void_p(made.ctypes.data), ctypes.c_size_t(made.nbytes)
                oidn.oidnReadBuffer(buffers["output"], ctypes.c_size_t(0), size, data)
        finally:
            oidn.oidnReleaseFilter(filtered)
            for buffer in buffers.values():
                oidn.oidnReleaseBuffer(buffer)
        self.check(self.handle)
        return pictures["output"]
