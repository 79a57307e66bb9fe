#!/usr/bin/env python3
"""What the oracle costs beside a GPU, in milliseconds a pass and in wall time until the stop.

Needs a machine with an NVIDIA card, the module `noisefloor`, CuPy, Mitsuba 3, and the scenes beside the human data.

The first table has what a pass takes: rendering 16 samples of each pixel, copying them from the card, pushing and judging
them, in a loop that does one after the other. The second has wall times. Each renderer and size is rendered until all tiles
stop, beside a session that waits for each verdict and beside one in the background, and then alone, with the passes of each.
"""

import time

import numpy as np

import noisefloor
from figures import HUMAN, table

# Renderers and sizes, as the ledger calls them, and the samples per pixel at which every tile stops in the second table.
CUDA, CORNELL = "CUDA, 60 lines", "Mitsuba, Cornell box"
CASES = {(CUDA, 1920, 1080): 2048, (CUDA, 3840, 2160): 2048, (CORNELL, 1920, 1080): 512, (CORNELL, 3840, 2160): 192,
         ("Mitsuba, modern-hall", 1920, 1080): 192}
# Tiles of both, and the samples at which those of the first stop.
TILE, LIMIT = 64, 2048
# Samples of each pixel in one call, and in a pass of the first table.
AT_ONCE, PASS = 4, 16
# Seconds after which the first table has seen enough passes.
ENOUGH = 8

# A room of two walls, a floor and a ball under a lamp and a sky: as little work for each sample as a path tracer can
# have, so that the oracle has the least time.
KERNEL = r"""
struct V { float x, y, z; };
__device__ V add(V a, V b, float k) { V r = {a.x + k * b.x, a.y + k * b.y, a.z + k * b.z}; return r; }
__device__ float dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
__device__ V unit(V a) { float k = rsqrtf(dot(a, a)); V r = {k * a.x, k * a.y, k * a.z}; return r; }
// PCG (O'Neill 2014), one stream for each pixel and pass
__device__ float draw(unsigned *s) {
    *s = *s * 747796405u + 2891336453u;
    unsigned w = ((*s >> ((*s >> 28) + 4)) ^ *s) * 277803737u;
    return ((w >> 22) ^ w) * 2.3283064e-10f;
}
extern "C" __global__ void trace(float *mean, int width, int height, int spp, unsigned seed) {
    int i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= width * height) return;
    unsigned s = (i * 9781u + seed * 6271u) | 1u;
    for (int k = 0; k < 4; k++) draw(&s);
    V sum = {0, 0, 0}, ball = {0, -0.5f, 0};
    for (int n = 0; n < spp; n++) {
        V o = {0, 0, 3}, light = {1, 1, 1};
        V d = unit({(2 * (i % width + draw(&s)) - width) / height, 1 - 2 * (i / width + draw(&s)) / height, -1.8f});
        for (int bounce = 0; bounce < 6; bounce++) {
            float t = 1e9f, b = dot(add(o, ball, -1), d);
            V normal = {0, 0, 0}, colour = {.7f, .7f, .7f}, from = add(o, ball, -1);
            float root = b * b - dot(from, from) + 0.25f, near = -b - sqrtf(fmaxf(root, 0));
            if (root > 0 && near > 1e-3f) { t = near; normal = unit(add(from, d, t)); colour = {.9f, .6f, .2f}; }
            float floor_at = (-1 - o.y) / d.y, back = (-1.5f - o.z) / d.z, left = (-1.5f - o.x) / d.x;
            if (floor_at > 1e-3f && floor_at < t) { t = floor_at; normal = {0, 1, 0}; colour = {.7f, .7f, .7f}; }
            if (back > 1e-3f && back < t) { t = back; normal = {0, 0, 1}; colour = {.7f, .7f, .7f}; }
            if (left > 1e-3f && left < t) { t = left; normal = {1, 0, 0}; colour = {.7f, .1f, .1f}; }
            if (t > 1e8f) {
                float lamp = d.y > 0.9f ? 2.5f : 0.4f;
                sum = {sum.x + light.x * lamp, sum.y + light.y * lamp, sum.z + light.z * lamp};
                break;
            }
            o = add(add(o, d, t), normal, 1e-3f);
            light = {light.x * colour.x, light.y * colour.y, light.z * colour.z};
            float z = 2 * draw(&s) - 1, phi = 6.2831853f * draw(&s), r = sqrtf(1 - z * z);
            V sphere = {r * cosf(phi), r * sinf(phi), z};
            d = unit(add(normal, sphere, 0.999f));
        }
    }
    mean[3 * i] = sum.x / spp;
    mean[3 * i + 1] = sum.y / spp;
    mean[3 * i + 2] = sum.z / spp;
}
"""


def renderer(kind, width, height):
    """A function of (spp, seed) that returns an array on the device when it is done; `fetch` of it brings one to memory."""
    if kind == CUDA:
        import cupy
        import cupyx
        trace = cupy.RawKernel(KERNEL, "trace", options=("--std=c++14",))
        mean = cupy.empty((height, width, 3), cupy.float32)
        def render(spp, seed):
            blocks = ((width * height + 127) // 128,)
            trace(blocks, (128,), (mean, *map(np.int32, (width, height, spp)), np.uint32(seed)))
            cupy.cuda.Device().synchronize()
            return mean
        # Memory that is pinned, and the same every time: a card writes into fresh memory at a tenth of the speed
        pinned = cupyx.empty_pinned((height, width, 3), np.float32)
        render.fetch = lambda image: image.get(out=pinned)
        return render
    import drjit
    import mitsuba
    mitsuba.set_variant("cuda_ad_rgb")
    if kind == CORNELL:
        scene = mitsuba.cornell_box()
        scene["sensor"]["film"] |= {"width": width, "height": height, "rfilter": {"type": "box"}}
        scene = mitsuba.load_dict(scene)
    else:
        scene = mitsuba.load_file(str(HUMAN.parent / "scenes/modern-hall/scene.xml"))
        size = mitsuba.traverse(scene.sensors()[0])
        size["film.size"] = [width, height]
        size.update()
    def render(spp, seed):
        return mitsuba.render(scene, spp=spp, seed=seed)[:, :, :3]
    def evaluate(image):
        drjit.eval(image)
        drjit.sync_thread()
    render.evaluate, render.fetch = evaluate, np.asarray
    return render


class Sums:
    """What a renderer sums up on the device, `AT_ONCE` samples of each pixel a call."""

    def __init__(self, render):
        self.render, self.calls, self.spp, self.sum = render, 0, 0, None

    def add(self):
        self.calls += 1
        mean = self.render(AT_ONCE, self.calls)
        # A copy: the renderer fills the same array again
        self.sum = mean * AT_ONCE if self.sum is None else self.sum + mean * AT_ONCE
        self.spp += AT_ONCE
        if hasattr(self.render, "evaluate"):
            self.render.evaluate(self.sum)

    def take(self):
        spp, mean = self.spp, self.sum / self.spp
        self.spp, self.sum = 0, None
        return spp, self.render.fetch(mean)


def parts(render, judged):
    """Milliseconds a pass for rendering, copying, pushing and judging, and the longest verdict."""
    seconds, longest, passes, begin = np.zeros(4), 0.0, 0, time.perf_counter()
    while not judged.done and passes * PASS < LIMIT and time.perf_counter() - begin < ENOUGH:
        passes += 1
        marks = [time.perf_counter()]
        image = render(PASS, passes)
        if hasattr(render, "evaluate"):
            render.evaluate(image)
        marks.append(time.perf_counter())
        image = np.ascontiguousarray(render.fetch(image), np.float32)
        marks.append(time.perf_counter())
        judged.push_image(PASS, image)
        marks.append(time.perf_counter())
        judged.judge()
        marks.append(time.perf_counter())
        took = np.diff(marks)
        seconds, longest = seconds + took, max(longest, took[3])
    return 1e3 * seconds / passes, 1e3 * longest


def alone(render, calls):
    sums, start = Sums(render), time.perf_counter()
    for _ in range(calls):
        sums.add()
    sums.take()
    return time.perf_counter() - start


def waiting(render, judged):
    """Wall time until the stop, and the calls of the renderer."""
    sums, start = Sums(render), time.perf_counter()
    while not judged.done:
        sums.add()
        if sums.spp >= judged.next_pass:
            judged.push_image(*sums.take())
            judged.judge()
    return time.perf_counter() - start, sums.calls


def background(render, judged):
    sums, start = Sums(render), time.perf_counter()
    with noisefloor.Background(judged, waiting=1) as beside:
        while wanted := beside.next_pass:
            if sums.spp >= wanted and not beside.pending:
                beside.push_image(*sums.take())
                beside.judge()
            if sums.spp < beside.spp_left:
                sums.add()
            else:
                beside.finish()
        stopped = time.perf_counter() - start
    return stopped, sums.calls


def main():
    renderers = {case: renderer(*case) for case in CASES}

    def passes():
        for (kind, width, height), render in renderers.items():
            render(PASS, 10**6)  # compiles
            judged = noisefloor.Session(width, height, params=noisefloor.Params(tile=TILE, max_spp=LIMIT))
            (rendered, *oracle), longest = parts(render, judged)
            *cells, judging = (f"{number:.1f}" for number in [rendered, *oracle])
            yield f"{kind}, {width}×{height}", *cells, f"{judging} ({longest:.0f})", f"×{sum(oracle) / rendered:.2f}"

    def walls():
        for (kind, width, height), render in renderers.items():
            params = noisefloor.Params(tile=TILE, max_spp=CASES[kind, width, height], schedule="growing", step=16)
            alone(render, 2)  # warms up
            waited, calls = waiting(render, noisefloor.Session(width, height, params=params))
            beside, more = background(render, noisefloor.Session(width, height, params=params))
            # Each beside as many samples without an oracle
            plain, as_many = alone(render, calls), alone(render, more)
            yield (f"{kind}, {width}×{height}", f"{plain:.2f} s", f"×{waited / plain:.2f}", f"×{beside / as_many:.2f}",
                   f"{100 * (more / calls - 1):.1f} %")

    table("gpu-pass", ["render", "copy", "push", "judge", "oracle : render"], passes())
    table("gpu-wall", ["alone", "a session that waits", "in the background", "samples beyond the stop"], walls())


if __name__ == "__main__":
    main()
