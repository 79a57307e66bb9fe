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
# By Cycles' names; what is not said is the highest
QUALITIES = {"HIGH": None, "BALANCED": 5, "FAST": 4}
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


class Denoiser:
    """Open Image Denoise on a device, as `device` says. As long as it lives, a GPU keeps filters and memory, which take it long
    to make; the processor makes them anew, and has its memory to itself while Cycles renders."""

    def __init__(self, path, kind=CPU, shared=None, prefilter="ACCURATE", quality="HIGH"):
        """shared: whether the device reads this process' memory, as every one of the processor does; others have their own.
        prefilter, quality: as Cycles calls them."""
        self.filters, self.buffers, self.prefilter, self.quality = {}, {}, prefilter, QUALITIES[quality]
        self.device = _Device(path, kind)
        self.shared = kind == CPU if shared is None else shared

    def __del__(self):
        self._release()

    def denoise(self, colour, albedo=None, normal=None):
        """float32 of shape (height, width, 3), or such a part of larger arrays. Albedo and normals are denoised first, if the
        prefilter is accurate, or taken to be clean, unless it is fast.

        Raises RuntimeError with what OIDN says."""
        # OIDN takes rows by their distance, which is not negative: a picture that lies from the bottom is denoised so
        rows = slice(None, None, -1 if colour.strides[0] < 0 else 1)
        given = {"color": colour, "albedo": albedo, "normal": normal}
        given = {role: _laid(picture[rows]) for role, picture in given.items() if picture is not None}
        made = numpy.empty(given["color"].shape, numpy.float32)
        try:
            images = {role: self._image(role, picture) for role, picture in given.items()}
            guides = [role for role in images if role != "color"]
            for role in guides if self.prefilter == "ACCURATE" else []:
                clean = self._image(f"clean {role}", numpy.empty_like(made), write=False)
                self._run({role: images[role], "output": clean}, [])
                images[role] = clean
            output = self._image("output", made, write=False)
            self._run({**images, "output": output}, ["hdr", *(["cleanAux"] if guides and self.prefilter != "FAST" else [])])
            if not self.shared:
                oidn, buffer = self.device.oidn, output[1]
                data, size = ctypes.c_void_p(made.ctypes.data), ctypes.c_size_t(made.nbytes)
                oidn.oidnReadBuffer(buffer, ctypes.c_size_t(0), size, data)
                self.device.check()
        finally:
            if self.shared:
                self._release()
        return made[rows]

    def _image(self, role, picture, write=True):
        """A picture, and the device's memory that has it; None where the device reads ours."""
        if self.shared:
            return picture, None
        oidn, device = self.device.oidn, self.device
        last = picture.strides[0] * (picture.shape[0] - 1) + picture.strides[1] * (picture.shape[1] - 1)
        size = ctypes.c_size_t(last + 3 * picture.itemsize)
        buffer, had = self.buffers.get(role, (None, 0))
        if had != size.value:
            if buffer:
                oidn.oidnReleaseBuffer(buffer)
            buffer = ctypes.c_void_p(oidn.oidnNewBuffer(device.handle, size))
            self.buffers[role] = buffer, size.value
            device.check()
        if write:
            oidn.oidnWriteBuffer(buffer, ctypes.c_size_t(0), size, ctypes.c_void_p(picture.ctypes.data))
        return picture, buffer

    def _run(self, images, flags):
        """Runs the filter for images of these roles, which is made if there is none."""
        oidn, device, roles = self.device.oidn, self.device, tuple(images)
        filtered = self.filters.get(roles)
        if filtered is None:
            filtered = self.filters[roles] = ctypes.c_void_p(oidn.oidnNewFilter(device.handle, b"RT"))
            set_flag = getattr(oidn, "oidnSetFilterBool", None) or oidn.oidnSetFilter1b
            for flag in flags:
                set_flag(filtered, flag.encode(), ctypes.c_bool(True))
            if self.quality:
                oidn.oidnSetFilterInt(filtered, b"quality", ctypes.c_int(self.quality))
        for role, (picture, buffer) in images.items():
            (height, width, _), (down, across, _) = picture.shape, picture.strides
            layout = [ctypes.c_size_t(number) for number in (width, height, 0, across, down)]
            if buffer:
                oidn.oidnSetFilterImage(filtered, role.encode(), buffer, FLOAT3, *layout)
            else:
                data = ctypes.c_void_p(picture.ctypes.data)
                oidn.oidnSetSharedFilterImage(filtered, role.encode(), data, FLOAT3, *layout)
        oidn.oidnCommitFilter(filtered)
        oidn.oidnExecuteFilter(filtered)
        device.check()

    def _release(self):
        for filtered in self.filters.values():
            self.device.oidn.oidnReleaseFilter(filtered)
        for buffer, _ in self.buffers.values():
            self.device.oidn.oidnReleaseBuffer(buffer)
        self.filters, self.buffers = {}, {}


def _laid(picture):
    """A picture whose pixels lie one after the other, at any distance."""
    whole = picture.dtype == numpy.float32 and picture.strides[2] == 4 and min(picture.strides) > 0
    return picture if whole else numpy.ascontiguousarray(picture, numpy.float32)


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
        self.check()
        if not self.handle:
            raise RuntimeError("Open Image Denoise cannot use this GPU")
        self.oidn.oidnCommitDevice(self.handle)
        self.check()
        if kind != CPU:
            self.kept[kind] = self.handle

    def __del__(self):
        if self.kind == CPU and getattr(self, "handle", None):
            self.oidn.oidnReleaseDevice(self.handle)

    def check(self):
        """Raises what has gone wrong: of the device, or, without one, of making it."""
        message, handle = ctypes.c_char_p(), self.handle or None
        if self.oidn.oidnGetDeviceError(handle, ctypes.byref(message)) != 0:
            said = (message.value or b"an error").decode(errors="replace")
            raise RuntimeError(f"Open Image Denoise: {said}")
