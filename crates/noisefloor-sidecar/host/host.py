"""The other end of noisefloor-sidecar: serves a renderer over standard input and output.

A host script defines a class and hands it to `serve`:

    import os, sys
    sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
    import host

    class Renderer:
        def __init__(self, init): ...   # imports the renderer, loads init["scene"]
        info = {...}                    # name, width, height, unit, repeats, warnings
        def sample(self, tiles): ...    # [(samples, array of height x width x 3 float32), ...], in the order of the tiles
        def first_hits(self, index, samples): ...   # optional: arrays of the albedo and the normals of the whole image
        def adaptive(self, threshold, samples, seed, part): ...   # optional: the image, or (x, y, width, height) of it, by the renderer's own sampling;
                                        # or that, the samples of its pixels as another, and (the fewest, those with a threshold finer by the root of two, the most)

    host.serve(Renderer)

A filter, such as a denoiser, has a name in `info`, and one method instead:

        def filter(self, width, height, frames): ...   # an array each; a frame: bytes of float32 RGB by name

With `gpus()`, a static method as `pick` takes it, a class says which GPUs it could use; `HOST_SCRIPT devices` prints
them. init["device"] is what the user has asked for: "auto", "cpu", "gpu", a number, or a part of a name; None if nothing.

`TileError` blames a failure on a tile; `rectangles` joins tiles for renderers to which every piece costs a start.
Import the renderer in `__init__`, not at the top: what it prints while it loads must not get into the stream of frames.
A frame is two little-endian u32 (length of header, length of payload), a header (a JSON object) and a payload (raw
little-endian float32, RGB, top row first). There is one reply to a request, in order. Needs only the standard library.
"""

import json
import os
import queue
import signal
import struct
import sys
import threading
import traceback

PROTOCOL = 1
MAX_HEADER = 1 << 20
PR_SET_PDEATHSIG = 1
# A long scene name or stack of causes must not push a reply over the limit.
MAX_ERROR = 4000
# Begins the line that lists GPUs: libraries print lines of their own.
LISTED = "noisefloor GPUs: "


class TileError(Exception):
    """A failure that one tile is to blame for."""

    def __init__(self, tile, message):
        super().__init__(message)
        self.tile = tile


def pick(wanted, gpus, warnings, trial=lambda gpu: None):
    """The GPU that `wanted` asks for, None for the processor; a line for the user, if any, is added to `warnings`.

    wanted: as in init["device"]; None is "cpu". gpus: a function that returns those that the renderer could use, best first, each a
    kind (such as "CUDA"), a name, and whatever the renderer knows it by, and why there are none. trial: raises if one does not work.
    `auto` goes on to the next GPU then, and to the processor; whatever else is asked for is an error if it does not work."""
    if wanted in (None, "cpu"):
        return None
    gpus, nowhere = gpus()
    some = gpus
    if wanted.isdigit():
        some = gpus[int(wanted) :][:1]
    elif wanted not in ("auto", "gpu"):
        some = [gpu for gpu in gpus if wanted.casefold() in f"{gpu[0]} {gpu[1]}".casefold()]
    reasons = []
    for gpu in some:
        try:
            trial(gpu)
            return gpu
        except Exception as error:
            reasons.append(f"{gpu[1]} ({gpu[0]}): {(str(error).strip() or type(error).__name__).splitlines()[-1]}")
    there = ", ".join(f"{number} is {gpu[1]} ({gpu[0]})" for number, gpu in enumerate(gpus))
    why = "; ".join(reasons) or (nowhere if not gpus else f"of the GPUs, {there}")
    if wanted == "auto":
        warnings.append(f"the processor does it, since no GPU works here: {why}")
        return None
    raise ValueError(f"device {wanted} cannot be used: {why}; `auto` takes the processor where no GPU works")


def cuda_gpus():
    """The GPUs of NVIDIA's driver, for `pick`. Loads nothing but the driver."""
    import ctypes

    try:
        driver = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return [], "there is no NVIDIA driver"
    error = driver.cuInit(0)
    count, gpus = ctypes.c_int(), []
    if error or driver.cuDeviceGetCount(ctypes.byref(count)):
        return [], f"NVIDIA's driver finds no device (error {error})"
    for number in range(count.value):
        name = ctypes.create_string_buffer(256)
        driver.cuDeviceGetName(name, len(name), number)
        gpus.append(("CUDA", name.value.decode(errors="replace"), number))
    return gpus, "NVIDIA's driver finds no device"


def gpus_of(script):
    """What `HOST_SCRIPT devices` says, for `pick`; in a process of its own, since a driver that has been looked at does not
    forget the devices it has shown."""
    import subprocess

    said = subprocess.run([sys.executable, "-I", script, "devices"], capture_output=True, text=True, check=False).stdout
    lines = [line.removeprefix(LISTED) for line in said.splitlines() if line.startswith(LISTED)]
    if not lines:
        return [], "nothing is known of GPUs"
    found = json.loads(lines[-1])
    return [(*gpu, number) for number, gpu in enumerate(found["gpus"])], found["nowhere"]


def _list(Host):
    """Prints the GPUs that a host could use, as kind and name, and why there are none."""
    gpus, nowhere = Host.gpus()
    print(LISTED + json.dumps({"gpus": [gpu[:2] for gpu in gpus], "nowhere": nowhere}))
    _end()


def serve(Host):
    """Answers requests until standard input ends or a request says quit. Does not return."""
    if sys.argv[1:] == ["devices"]:
        _list(Host)

    # Ctrl-C in a terminal reaches every process of the group; when to stop is for the parent to say.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    _watch()

    # The protocol gets descriptors of its own. Whatever prints to standard output from now on, Python or not, prints to
    # standard error; whatever reads standard input reads nothing.
    requests_from = os.fdopen(os.dup(0), "rb")
    replies_to = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)

    # The end of standard input is noticed while the renderer is busy, too: a renderer whose parent is gone must end.
    requests = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(requests_from, requests), daemon=True).start()

    renderer = None
    while True:
        request, data = requests.get()
        payload = []
        try:
            renderer, reply, payload = _answer(Host, renderer, request, data)
        except BaseException as error:  # a renderer may raise SystemExit, too
            traceback.print_exc()
            os.write(2, b"\0")  # the reader knows by it that it has read all of that
            reply, payload = {"ok": False, "error": _describe(error)}, []
            if isinstance(error, TileError):
                reply["tile"] = error.tile
        _send(replies_to, reply, payload)
        if request.get("op") == "quit":
            _end()


def _watch():
    """Kills what the renderer has started once this process has ended, however it ends.

    A child waits for that (Linux only). It is in the process group that the parent has put this process at the head of; by hand,
    in a shell's group, nothing is killed."""
    if sys.platform != "linux" or os.getpgrp() != os.getpid():
        return
    import ctypes

    head = os.getpid()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    if os.fork() > 0:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        return
    # The streams of this process must end with it
    os.closerange(0, 3)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGTERM))
    if os.getppid() == head:
        signal.sigwait({signal.SIGTERM})
    os.killpg(head, signal.SIGKILL)


def rectangles(tiles, alike):
    """Joins tiles that are `alike` in what these keys name into rectangles, for renderers to which each rectangle costs a start:
    first along rows, then rows of one extent. Yields (x, y, width, height), the values of the keys, and which tiles are inside."""

    def join(parts, along, extent, across, other):
        joined = []
        for part in sorted(parts, key=lambda p: (*(p[key] for key in alike), p[across], p[other], p[along])):
            last = joined[-1] if joined else None
            same = last and all(last[key] == part[key] for key in [*alike, across, other])
            if same and last[along] + last[extent] == part[along]:
                last[extent] += part[extent]
                last["members"] = last["members"] + part["members"]
            else:
                joined.append(dict(part))
        return joined

    parts = [{**tile, "members": [position]} for position, tile in enumerate(tiles)]
    parts = join(join(parts, "x", "width", "y", "height"), "y", "height", "x", "width")
    for part in parts:
        region = tuple(part[side] for side in ["x", "y", "width", "height"])
        yield region, tuple(part[key] for key in alike), part["members"]


def _answer(Host, renderer, request, data):
    """The renderer from now on, the reply, and its payload."""
    op = request.get("op")
    if op == "quit":
        return renderer, {"ok": True}, []
    if op == "init":
        if request.get("protocol") != PROTOCOL:
            raise ValueError(f"protocol {request.get('protocol')} is asked for, this is {PROTOCOL}")
        renderer = Host(request)
        return renderer, {"ok": True, **renderer.info}, []
    if renderer is None:
        raise ValueError("the first request has to be init")
    if op == "sample":
        tiles = request["tiles"]
        for tile in tiles:
            _check(tile, renderer.info)
        batches = renderer.sample(tiles)
        if len(batches) != len(tiles):
            raise ValueError(f"{len(batches)} batches for {len(tiles)} tiles")
        payload = []
        for tile, (samples, mean) in zip(tiles, batches):
            if samples > 0:
                payload.append(_bytes(mean, tile["width"], tile["height"]))
        return renderer, {"ok": True, "samples": [int(samples) for samples, _ in batches]}, payload
    if op == "first_hits":
        render = getattr(renderer, "first_hits", lambda index, samples: None)
        pictures = render(request["index"], request["samples"])
        if pictures is None:
            return renderer, {"ok": True, "first_hits": False}, []
        albedo, normal = pictures
        width, height = renderer.info["width"], renderer.info["height"]
        return renderer, {"ok": True, "first_hits": True}, [_bytes(albedo, width, height), _bytes(normal, width, height)]
    if op == "adaptive":
        render = getattr(renderer, "adaptive", lambda threshold, samples, seed, part: None)
        image = render(request["threshold"], request["samples"], request["seed"], request["part"])
        if image is None:
            return renderer, {"ok": True, "adaptive": False}, []
        size = request["part"][2:] if request["part"] else (renderer.info["width"], renderer.info["height"])
        image, samples, limits = image if isinstance(image, tuple) else (image, None, None)
        # A reply has less than 4 GiB
        if samples is None or 2 * 12 * size[0] * size[1] >= 2**32:
            return renderer, {"ok": True, "adaptive": True}, [_bytes(image, *size)]
        counts = [float(limit) for limit in limits]
        return renderer, {"ok": True, "adaptive": True, "counts": counts}, [_bytes(image, *size), _bytes(samples, *size)]
    if op == "filter":
        width, height, names, count = (request[key] for key in ["width", "height", "pictures", "frames"])
        size = 12 * width * height
        if len(data) != size * len(names) * count:
            raise ValueError(f"{len(data)} bytes for {count} times {len(names)} pictures of {width}x{height}")
        pieces = iter(memoryview(data)[start : start + size] for start in range(0, len(data), size))
        frames = [{name: next(pieces) for name in names} for _ in range(count)]
        return renderer, {"ok": True}, [_bytes(made, width, height) for made in renderer.filter(width, height, frames)]
    raise ValueError(f"{op!r} is no operation")


def _check(tile, info):
    x, y, width, height = tile["x"], tile["y"], tile["width"], tile["height"]
    if min(x, y) < 0 or min(width, height) < 1 or x + width > info["width"] or y + height > info["height"]:
        size = f"{info['width']}x{info['height']}"
        raise TileError(tile["index"], f"{width}x{height} pixels at {x}, {y} are not inside the image of {size}")
    if tile["samples"] < 1:
        raise TileError(tile["index"], "at least one sample has to be asked for")


def _bytes(array, width, height):
    """The bytes of an array of numbers, without a copy where they are float32 in one piece."""
    view = memoryview(array.astype("<f4", copy=False) if hasattr(array, "astype") else array)
    data = view.cast("B") if view.c_contiguous else memoryview(view.tobytes())
    if data.nbytes != 12 * width * height:
        raise ValueError(f"{data.nbytes} bytes for {width}x{height} pixels of three float32")
    return data


def _receive(stream, requests):
    try:
        while True:
            prefix = stream.read(8)
            if len(prefix) < 8:
                break
            header, payload = struct.unpack("<II", prefix)
            if header > MAX_HEADER:
                break
            text, data = stream.read(header), stream.read(payload)
            if len(text) < header or len(data) < payload:
                break
            requests.put((json.loads(text), data))
    except BaseException:
        traceback.print_exc()
    _end()


def _send(stream, reply, payload):
    header = json.dumps(reply).encode()
    try:
        stream.write(struct.pack("<II", len(header), sum(part.nbytes for part in payload)))
        stream.write(header)
        for part in payload:
            stream.write(part)
        stream.flush()
    except OSError:  # the parent is gone
        _end()


def _describe(error):
    name = type(error).__name__
    return f"{name}: {error}"[:MAX_ERROR] if str(error) else name


def _end():
    """Ends the process without running the renderer's destructors, which may hang or crash."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            pass
    os._exit(0)
