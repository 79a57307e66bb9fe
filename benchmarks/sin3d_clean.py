#!/usr/bin/env python3
"""Turns a SIN3D view rendered with few samples into the stack of a clean picture and its noise, in the layout of a corpus.

    pip install mitsuba==3.9.1 mitsuba-oidn==0.1.2; benchmarks/sin3d_clean.py VIEW BOX OUT

VIEW has zone<NN>/batch_<first>_<last>.exr, each the mean of those 64 samples, with the pixel filter of the study; BOX the
same zones with a box filter, whose noise differs from pixel to pixel, as a denoiser expects. The clean picture is the
mean of BOX, denoised (Open Image Denoise). Noise of one sample is the difference of two batches, over sqrt(2/64): three realisations, of which
none shares a batch with another. The stack has the means of samples 1 to 1024, 1025 to 2048 and 2049 to 6144 as they would
be with that noise: people judged these views near 5000 samples, where noise hides hardly anything of itself, and a mean of
few samples would hide most of it."""
import math, os, pathlib, sys
import numpy as np, mitsuba as mi, mitsuba_oidn as oidn

mi.set_variant("scalar_rgb")
view, box, out = map(pathlib.Path, sys.argv[1:4])
device = oidn.Device(oidn.DeviceType.CPU)
device.commit()
read = lambda zone: [np.array(mi.Bitmap(str(p)), dtype=np.float32)[:, :, :3] for p in sorted(zone.glob("batch_*.exr"))]
for zone in sorted(view.glob("zone*")):
    batches = read(zone)[:6]
    assert len(batches) == 6, f"{zone}: six batches of 64 samples are needed"
    color = np.ascontiguousarray(np.maximum(np.mean(read(box / zone.name), axis=0), 0))
    clean = np.empty_like(color)
    filter = device.new_filter("RT")
    filter.hdr, filter.quality = True, oidn.Quality.High
    filter.set_image("color", color)
    filter.set_image("output", clean)
    filter.execute()
    noise = [(batches[i] - batches[i + 1]) / math.sqrt(2 / 64) for i in (0, 2, 4)]
    folder = out / zone.name
    folder.mkdir(parents=True, exist_ok=True)
    for (first, last), unit in zip([(0, 1024), (1024, 2048), (2048, 6144)], noise):
        picture = clean + unit / math.sqrt(last - first)
        path = folder / f"batch_{first:05d}_{last:05d}.exr"
        mi.Bitmap(np.ascontiguousarray(picture)).write(str(path))
os.system(f"cp {view}/thresholds.csv {out}/")
