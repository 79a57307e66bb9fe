"""A renderer that can be told to misbehave by the options of init: "how", and "once", a file that says it was done.

It misbehaves when samples after the first are asked for."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import array
import struct
import time

import host

# The descriptor of the replies is what host.py duplicates last.
duplicate = os.dup
replies = None


def remember(descriptor):
    global replies
    replies = duplicate(descriptor)
    return replies


os.dup = remember


def value(seed, x, y, sample, channel):
    """The renderer, which tests compute again."""
    return (seed * 31 + x * 7 + y * 13 + sample * 17 + channel * 5) % 97 / 97


def send(header, payload=0):
    """Past host.py, straight into the stream of replies."""
    with open(replies, "wb", buffering=0, closefd=False) as stream:
        stream.write(struct.pack("<II", len(header), payload) + header)
    time.sleep(1000)


# Headers, and the length of the payload that they announce
REPLIES = {
    "announce a long payload": (b"{}", 0xFFFFFFFF),
    "announce a pixel too many": (b"{}", 12 * 48 * 40 + 12),
    "announce a long header": (b" " * ((1 << 20) + 1),),
    "send no JSON": (b"\xff{",),
    "send a list": (b"[1, 2]",),
    "nest deeply": (b'{"x":' * 200000,),
    "send strange counts": (b'{"ok": true, "samples": [-1, 1e99, 3, 4]}',),
    "send too few counts": (b'{"ok": true, "samples": [0]}',),
    "claim many samples": (b'{"ok": true, "samples": [1, 1, 1, 4294967295]}',),
    "send no counts": (b'{"ok": true}',),
}


class Fake:
    @staticmethod
    def gpus():
        """Two, of which the first does not work."""
        print("a library that talks")
        return [("CUDA", "Alpha", 0), ("OPTIX", "Beta\x1b[31m 2", 1)], "there is no driver"

    @staticmethod
    def trial(gpu):
        if gpu[1] == "Alpha":
            raise MemoryError("too little memory")

    def __init__(self, init):
        self.seed, self.options = init["seed"], init["options"]
        warnings = ["max_depth %s, threads %s" % (init["max_depth"], init["threads"])]
        gpu = host.pick(init["device"], self.gpus, warnings, self.trial)
        self.info = {
            "name": "Fake 1" + (" on " + gpu[1] if gpu else ""),
            "width": init["width"] or 48,
            "height": init["height"] or 40,
            "unit": "samples-per-pixel",
            "repeats": "samples",
            "stratified": True,
            "warnings": warnings,
        }
        starts = 0
        if "pids" in self.options:
            with open(self.options["pids"], "a+") as file:
                file.write("%d\n" % os.getpid())
                file.seek(0)
                starts = len(file.readlines())
        if self.options.get("how") == "paint":
            self.info["name"] = "Fake\x1b[31m 1"
            self.info["warnings"] = ["right to left: \u202e"]
        if self.told("paint the unit"):
            self.info["unit"] = "\x1b[2J"
        if self.options.get("fork") == "yes":
            if os.fork() == 0:
                with open(self.options["pids"], "a") as file:
                    file.write("%d\n" % os.getpid())
                for descriptor in range(3):
                    os.close(descriptor)
                time.sleep(1000)
        if self.told("refuse the scene"):
            raise ValueError("no such lamp")
        if self.told("die at once"):
            os._exit(3)
        if self.told("claim a huge image"):
            self.info["width"] = 1 << 40
        if self.told("describe nothing"):
            self.info = {}
        if self.told("ignore the end"):
            host._end = lambda: time.sleep(1000)
        if self.options.get("how") in ("stop late", "stop much too late"):
            self.info["late"] = 1 << 17
        if self.options.get("how") == "change" and starts > 1:
            self.info["width"] += 1

    def told(self, how):
        if self.options.get("how") != how:
            return False
        once = self.options.get("once")
        if once is None:
            return True
        if os.path.exists(once):
            return False
        open(once, "w").close()
        return True

    def sample(self, tiles):
        late = any(tile["first"] > 0 for tile in tiles)
        if late:
            self.misbehave()
        batches = []
        for tile in tiles:
            samples, first = tile["samples"], tile["first"]
            mean = array.array("f", (
                sum(value(self.seed, x, y, first + s, c) for s in range(samples)) / samples
                for y in range(tile["y"], tile["y"] + tile["height"])
                for x in range(tile["x"], tile["x"] + tile["width"])
                for c in range(3)
            ))
            if late and tile["index"] == 1:
                if self.told("send NaN"):
                    mean = array.array("f", [float("nan"), float("inf"), float("-inf")] * (len(mean) // 3))
                if self.told("send some NaN"):
                    mean[5] = float("nan")
                if self.told("send mostly NaN"):
                    for pixel in range(len(mean) // 3):
                        if pixel % 6 != 0:
                            mean[3 * pixel] = float("nan")
                if self.told("send negative light"):
                    for at in range(0, len(mean), 7):
                        mean[at] = -1e6
                if self.told("send too little"):
                    mean = mean[3:]
                if self.told("be exhausted"):
                    samples = 0
            samples += late and {"stop late": 3, "give too many": 3, "stop much too late": 100000}.get(self.options.get("how"), 0)
            batches.append((samples, mean))
        if late and self.told("forget a tile"):
            batches.pop()
        return batches

    def misbehave(self):
        if self.told("print"):
            print("to standard output", flush=True)
            os.system("echo a child to standard output")
            os.write(1, b"\xff" * 10000)
        if self.told("read standard input"):
            assert sys.stdin.read() == ""
        if self.told("die") or self.told("change"):
            sys.stderr.write("x" * 10000 + "\nout of lamps\n")
            os._exit(7)
        if self.told("exit"):
            sys.exit("I want out")
        if self.told("crash"):
            os.abort()
        if self.told("hang"):
            time.sleep(1000)
        if self.told("paint"):
            sys.stderr.write("\x1b]0;owned\x07")
            raise host.TileError(2, "no memory\x1b[2J for textures")
        if self.told("refuse"):
            raise host.TileError(2, "no memory for textures")
        if self.told("close standard output"):
            os.close(replies)
            time.sleep(1000)
        for how, reply in REPLIES.items():
            if self.told(how):
                send(*reply)
        if self.told("stop in the middle"):
            os.write(replies, struct.pack("<II", 100, 0) + b"{")
            os._exit(0)

    def adaptive(self, threshold, samples, seed, part):
        if self.options.get("how") not in ("sample adaptively", "count samples", "count to no limit", "count no numbers"):
            return None
        value = [threshold, float(samples or 0), float(seed)]
        _, _, width, height = part or (0, 0, self.info["width"], self.info["height"])
        picture = array.array("f", value * (width * height))
        if self.options["how"] == "sample adaptively":
            return picture
        counts = array.array("f", (number for pixel in range(width * height) for number in [32 + pixel] * 3))
        if self.options["how"] == "count no numbers":
            counts[0] = float("nan")
        return picture, counts, (32, 0 if self.options["how"] == "count to no limit" else 64, samples)


host.serve(Fake)
