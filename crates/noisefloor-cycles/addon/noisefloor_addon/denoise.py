"""The finished picture through Open Image Denoise, the library that Blender has beside it for Cycles.

Cycles can only denoise its own buffers, which hold the last batch. The C interface is that of OIDN 1.4 to
2.x.
"""

import ctypes
import glob
import os

import bpy
import numpy

CPU, FLOAT3 = 1, 3


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


def denoise(path, colour, albedo=None, normal=None):
    """colour, albedo, normal: float32 of shape (height, width, 3). Albedo and normals are denoised first, as
    Cycles does.

    Raises RuntimeError with what OIDN says."""
    oidn = ctypes.CDLL(path)
    for name in ["oidnNewDevice", "oidnNewFilter"]:
        getattr(oidn, name).restype = ctypes.c_void_p
    oidn.oidnGetDeviceError.restype = ctypes.c_int
    # Pictures in this process' memory can be read by every device of the CPU
    device = ctypes.c_void_p(oidn.oidnNewDevice(CPU))
    oidn.oidnCommitDevice(device)
    try:
        guides = {
            name: picture
            for name, picture in [("albedo", albedo), ("normal", normal)]
            if picture is not None
        }
        guides = {name: _run(oidn, device, {name: picture}, name, []) for name, picture in guides.items()}
        return _run(
            oidn, device, {"color": colour, **guides}, "color", ["hdr", *(["cleanAux"] if guides else [])]
        )
    finally:
        oidn.oidnReleaseDevice(device)


def _run(oidn, device, pictures, result, flags):
    filtered = ctypes.c_void_p(oidn.oidnNewFilter(device, b"RT"))
    pictures = {name: numpy.ascontiguousarray(picture, numpy.float32) for name, picture in pictures.items()}
    pictures["output"] = numpy.empty_like(pictures[result])
    height, width = pictures["output"].shape[:2]
    for name, picture in pictures.items():
        oidn.oidnSetSharedFilterImage(
            filtered,
            name.encode(),
            ctypes.c_void_p(picture.ctypes.data),
            FLOAT3,
            *(ctypes.c_size_t(number) for number in (width, height, 0, 0, 0)),
        )
    set_flag = getattr(oidn, "oidnSetFilterBool", None) or oidn.oidnSetFilter1b
    for flag in flags:
        set_flag(filtered, flag.encode(), ctypes.c_bool(True))
    oidn.oidnCommitFilter(filtered)
    oidn.oidnExecuteFilter(filtered)
    oidn.oidnReleaseFilter(filtered)
    message = ctypes.c_char_p()
    if oidn.oidnGetDeviceError(device, ctypes.byref(message)) != 0:
        raise RuntimeError(f"Open Image Denoise: {(message.value or b'an error').decode(errors='replace')}")
    return pictures["output"]
