"""A filter that doubles the first of its pictures, and can be told to misbehave by the first value of it."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import array

import host


class Fake:
    def __init__(self, init):
        self.info = {"name": "Fake filter, threads %s" % init["threads"], "warnings": ["on %s" % init["device"]]}

    def filter(self, width, height, frames):
        return [self.one(pictures) for pictures in frames]

    def one(self, pictures):
        values = array.array("f", bytes(pictures["radiance"]))
        if values[0] == -1:
            os._exit(3)
        if values[0] == -2:
            raise ValueError("this picture is refused")
        if values[0] == -3:
            return array.array("f", [float("nan")] * len(values))
        if values[0] == -4:
            return values[:-3]
        return array.array("f", [2 * v + len(pictures) - 1 for v in values])


if __name__ == "__main__":
    host.serve(Fake)
