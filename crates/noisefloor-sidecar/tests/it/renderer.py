"""A renderer of one number a pixel and sample, for tests: PFM or raw bytes out."""

import array
import os
import sys
import time

keys = dict(word.split("=", 1) for word in sys.argv[1:])
size = (20, 12)
x0, x1 = int(keys.get("x0", 0)), int(keys.get("x1", size[0]))
y0, y1 = int(keys.get("y0", 0)), int(keys.get("y1", size[1]))
if keys.get("how") == "whole":
    x0, x1, y0, y1 = 0, size[0], 0, size[1]
if keys.get("how") == "larger":
    x1 += 1
if keys.get("how") == "fail":
    print("no lamp in", keys["scene"])
    sys.exit(3)
if "exists" in keys:
    open(keys["exists"]).close()
if keys.get("how") == "paint":
    sys.exit("\x1b]0;owned\x07")
if keys.get("how") == "fork":
    child = os.fork()
    if child == 0:
        time.sleep(1000)
    with open(keys["log"] + ".fork", "w") as file:
        file.write(str(child))
if keys.get("how") == "hang":
    time.sleep(1000)
with open(keys["log"], "a") as log:
    log.write("%s %s\n" % (keys["seed"], keys["spp"]))
if keys.get("how") == "nothing":
    sys.exit(0)
rows = [[(x, y, int(keys["spp"])) for x in range(x0, x1)] for y in range(y0, y1)]
with open(keys["out"], "wb") as out:
    if keys.get("how") == "garbage":
        out.write(b"garbage")
    else:
        out.write(b"PF\n%d %d\n-1.0\n" % (x1 - x0, y1 - y0))
        for row in reversed(rows):
            array.array("f", [v for pixel in row for v in pixel]).tofile(out)
if keys.get("how") == "two":
    open(keys["out"] + ".bak", "w").close()
