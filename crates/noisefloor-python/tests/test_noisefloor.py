"""Tests of the installed module: python -m unittest discover crates/noisefloor-python/tests"""

import ast
import concurrent.futures
import contextlib
import copy
import inspect
import json
import multiprocessing
import os
import pathlib
import pickle
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings
import zlib

import numpy as np

import noisefloor as nf

EDGE = 32
PARAMS = nf.Params(tile=EDGE, max_spp=400)


def batch(tile, first, spp):
    """A wall with noise that shrinks as it should; the same for the same samples."""
    noise = np.random.default_rng([tile.index, first]).uniform(-1, 1, (tile.height, tile.width, 3))
    return (0.5 + 0.4 * noise / np.sqrt(spp)).astype(np.float32)


def render(request):
    """What a pool of processes runs."""
    if request.spp == 0:
        raise nf.FaultError("nothing to render")
    return batch(request.tile, request.first, request.spp)


def finish(session, verdicts=1000):
    """Or goes on for so many verdicts; the stops."""
    while not session.done and verdicts:
        for request in session.requests():
            session.push(request.tile, request.spp, batch(request.tile, request.first, request.spp))
        session.judge()
        verdicts -= 1
    return session.stops()


@contextlib.contextmanager
def beside(work, threads=1):
    """Others work over and over meanwhile."""
    going = True

    def keep_working():
        while going:
            work()

    others = [threading.Thread(target=keep_working) for _ in range(threads)]
    for other in others:
        other.start()
    try:
        yield
    finally:
        going = False
        for other in others:
            other.join()


def in_child(work):
    """Exit code of a forked child that works, or None if it hangs."""
    with warnings.catch_warnings():
        # Python warns of forks beside threads from 3.12 on
        warnings.simplefilter("ignore", DeprecationWarning)
        child = multiprocessing.get_context("fork").Process(target=work)
        child.start()
    child.join(600)
    code = child.exitcode
    child.kill()
    return code


class Test(unittest.TestCase):
    def fail_as_said(self, cases):
        """Calls raise errors of these types, with these words."""
        for kind, words, call in cases:
            with self.subTest(words), self.assertRaisesRegex(kind, words):
                call()

    def folder(self):
        """One that is gone after the test."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        return pathlib.Path(folder.name)


def noisy(seed, spp, shape=(64, 96, 3)):
    ramp = np.linspace(0.2, 0.8, shape[1], dtype=np.float32)[None, :, None]
    return (ramp + np.random.default_rng(seed).normal(0, 1 / np.sqrt(spp), shape)).astype(np.float32)


def smooth(radiance):
    """A mean over 9x9 pixels: a denoiser, of module level so that it can be pickled."""
    padded = np.pad(radiance, ((4, 4), (4, 4), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (9, 9), axis=(0, 1))
    return windows.mean(axis=(-2, -1)).astype(np.float32)


EYES = """version = 1
[[person]]
name = "anna"
factor = 1.4
interval = [1.2, 1.65]
scatter = 0.3
answers = 38
date = "2026-11-24"
model = "a digest"
[person.display]
pixels-per-degree = 44.0
distance-mm = 600.0
gamma = 2.2
ambient = "dim"
"""


class EyesTest(Test):
    def test_eyes_are_read_and_used(self):
        path = self.folder() / "eyes.toml"
        self.assertRaises(OSError, nf.eyes, path)
        path.write_text(EYES)
        eyes = nf.eyes(path)
        self.assertEqual((eyes.name, eyes.factor, eyes.interval, eyes.date), ("anna", 1.4, (1.2, 1.65), "2026-11-24"))
        self.assertEqual(eyes.viewing.pixels_per_degree, 44)
        sent = pickle.loads(pickle.dumps(eyes))
        self.assertEqual((repr(sent), sent.viewing, sent.interval), (repr(eyes), eyes.viewing, eyes.interval))
        params = nf.Params(viewing=eyes.viewing, audience=eyes.audience)
        self.assertIn("audience=(1.4, 0.0)", repr(params))
        path.write_text("colour = 1")
        self.assertRaises(nf.ParameterError, nf.eyes, path)


def samples(kept, tile, spp, number):
    """Those of tests/tests/it/bindings.rs, to the bit."""
    place = np.arange(3 * tile.height * tile.width, dtype=np.uint32)
    mixed = place * np.uint32(0x9E3779B1) + np.uint32(number * 0x85EBCA77 % 2**32)
    mixed = (mixed ^ mixed >> 15) * np.uint32(0x2C1B3C6D)
    mixed = ((mixed ^ mixed >> 12) >> 8).reshape(tile.height, tile.width, 3)
    y, x = np.mgrid[tile.slices]
    light = kept["light"] * (0.2 + x / kept["width"]) * np.where((x + 2 * y) % 50 < 20, 0.3, 1.0)
    noise = kept["noise"] * (mixed / 2**23 - 1) / np.sqrt(spp)
    mean = np.maximum(light[..., None] * (1 + noise), 0).astype(np.float32)
    if kept["holes"]:
        mean[mixed[..., 0] % 499 == 0] = np.nan
    return mean


class Sessions(Test):
    def replay(self, kept, renew):
        """A session of Rust, pushed by three threads; `renew` makes another one of it after each verdict."""
        params = nf.Params(**kept["params"] | {"audience": tuple(kept["params"]["audience"])})
        session = nf.Session(kept["width"], kept["height"], nf.Oracle(kept["people"]), params)
        tiles = [request.tile for request in session.requests()]
        sums = [[0, np.zeros((tile.height, tile.width, 3))] for tile in tiles]

        def push(batches):
            for number, request in batches:
                mean, total = samples(kept, request.tile, request.spp, number), sums[request.tile.index]
                total[0] += request.spp
                total[1] += mean.astype(np.float64) * request.spp
                if kept["running"]:
                    session.push_running(request.tile, total[0], (total[1] / total[0]).astype(np.float32))
                else:
                    session.push(request.tile, request.spp, mean)

        number = 0
        for expected in kept["rounds"]:
            batches = list(enumerate(session.requests(), number))
            number += len(batches)
            with concurrent.futures.ThreadPoolExecutor(3) as pool:
                list(pool.map(push, (batches[k::3] for k in range(3))))
            session.judge()
            stops = {stop.tile.index: (stop.spp, stop.reason) for stop in session.stops()}
            spp = session.spp()
            for tile, (*state, probability) in zip(tiles, expected):
                found = stops.get(tile.index, (spp[tile.y, tile.x], "open"))
                self.assertEqual((*found,), (*state,), tile)
                verdict = session.verdict(tile)
                self.assertEqual(verdict is None, probability is None)
                if verdict:
                    self.assertAlmostEqual(verdict.probability, probability, delta=1e-5)
            session = renew(session)
        self.assertEqual((session.done, session.requests(), session.expected_samples), (True, [], 0))
        self.assertEqual(len(session.warnings), kept["warnings"])
        return session

    def test_sessions_are_those_of_rust_also_if_they_are_saved_or_pickled(self):
        path = self.folder() / "session.nfc"

        def resumed(session):
            session.save(path, "wall")
            session.resume(str(path), "wall")
            return session

        file = pathlib.Path(__file__).parents[3] / "fixtures" / "sessions.json"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for number, kept in enumerate(json.loads(file.read_text())):
                with self.subTest(number):
                    renew = (lambda session: session, resumed, copy.deepcopy)[number % 3]
                    session = self.replay(kept, renew)
        shape = (session.height, session.width)
        picture, spp, p, noise = session.image(), session.spp(), session.probability(), session.visible_noise()
        self.assertEqual([(a.shape, a.dtype) for a in (picture, spp, p, noise)],
                         [((*shape, 3), np.float32), (shape, np.uint64), (shape, np.float32), (shape, np.float32)])
        for stop in session.stops():
            self.assertTrue((spp[stop.tile.slices] == stop.spp).all())
            self.assertTrue((p[stop.tile.slices] == np.float32(stop.probability)).all())

    def test_running_means_lie_where_they_were_pushed(self):
        frame = np.arange(80 * 96 * 3, dtype=np.float32).reshape(80, 96, 3)
        whole = nf.Session(96, 80, params=PARAMS)
        whole.push_image(1, frame)
        whole.push_running(0, 2, np.full((EDGE, EDGE, 3), 7.0))
        np.testing.assert_allclose(whole.image()[:EDGE, :EDGE], 7.0, rtol=1e-4)
        running = nf.Session(96, 80, params=PARAMS)
        running.push_running_image(1, frame)
        running.push_running_image(3, frame + 2)
        np.testing.assert_allclose(running.image(), frame + 2, rtol=1e-5)
        with self.assertRaises(nf.BatchError):
            running.push_running_image(3, frame)

    def test_a_float32_array_is_read_where_it_lies(self):
        statm = pathlib.Path("/proc/self/statm")
        if not statm.exists():
            self.skipTest("no /proc")
        resident = lambda: int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
        # 32 MiB: a copy would show in the resident size
        session = nf.Session(2048, 1365, params=nf.Params(tile=512))
        frame = np.ones((1365, 2048, 3), dtype=np.float32)
        for _ in range(2):
            session.push_image(1, frame)  # touches both halves of the film
        before, seen = resident(), [0]
        with beside(lambda: seen.append(resident())):
            for _ in range(3):
                session.push_image(1, frame)
        self.assertLess(max(seen) - before, frame.nbytes // 2)

    def test_arrays_in_any_order_of_memory_are_the_same_picture(self):
        picture, other = (noisy(seed, 50, (80, 96, 3)) for seed in (3, 4))
        planes = np.ascontiguousarray(picture.T)  # (3, width, height), as some renderers keep them
        wide = np.zeros((80, 2 * 96, 3), np.float32)
        wide[:, ::2] = picture
        orders = {
            "Fortran": np.asfortranarray(picture),
            "planes.T": planes.T,
            "rows apart": wide[:, ::2],
            "upside down": np.ascontiguousarray(picture[::-1])[::-1],
            "float64": np.asfortranarray(picture.astype(np.float64)),
        }
        encoded = np.asfortranarray(np.clip(picture, 0, 1))
        for name, array in orders.items():
            with self.subTest(name):
                self.assertTrue(np.array_equal(array, picture))
                whole, tiles = (nf.Session(96, 80, params=PARAMS) for _ in range(2))
                whole.push_image(50, array)
                for request in tiles.requests():
                    tiles.push(request.tile.index, 50, array[request.tile.slices])
                for session in (whole, tiles):
                    self.assertTrue(np.array_equal(session.image(), picture))
                self.assertEqual(nf.metrics(array, picture).psnr, np.inf)
                same = nf.judge(array, 50, other, 50), nf.judge(picture, 50, other, 50)
                self.assertEqual(*([(v.tile.index, v.probability) for v in found.verdicts] for found in same))
                path = self.folder() / "picture.exr"
                nf.write(path, array)
                self.assertTrue(np.array_equal(nf.read(path)[0], picture))
        self.assertEqual(nf.metrics(encoded, np.ascontiguousarray(encoded), encoding="srgb").psnr, np.inf)

    def test_checkpoints_are_of_one_job(self):
        session = nf.Session(64, 64, params=PARAMS)
        folder = self.folder()
        session.save(folder / "session.nfc", "wall")
        (folder / "other.nfc").write_bytes(b"something else entirely")
        self.fail_as_said([
            (nf.CheckpointError, "its job is wall, not hall", lambda: session.resume(folder / "session.nfc", "hall")),
            (FileNotFoundError, "none.nfc", lambda: session.resume(folder / "none.nfc", "wall")),
            (FileNotFoundError, "folder", lambda: session.save(folder / "no" / "folder", "wall")),
            (nf.CheckpointError, "first bytes", lambda: session.resume(folder / "other.nfc", "wall")),
        ])

    def test_others_run_while_the_oracle_judges(self):
        session = nf.Session(1024, 1024, params=nf.Params(tile=64))
        for seed in range(2):
            session.push_image(50, noisy(seed, 50, (1024, 1024, 3)))
        ticks = []
        with beside(lambda: ticks.append(time.monotonic())):
            began = time.monotonic()
            session.judge()
            ended = time.monotonic()
        # With the lock held, no tick would fall into the middle of the call
        middle = [t for t in ticks if began + 0.25 * (ended - began) < t < began + 0.75 * (ended - began)]
        self.assertGreater(len(middle), 10)

    def test_a_caller_can_end_all_tiles(self):
        session = nf.Session(64, 64, params=PARAMS)
        self.assertEqual([stop.reason for stop in session.close_all("time-limit")], ["time-limit"] * 4)
        self.assertTrue(session.done)


class Backgrounds(Test):
    def passes(self, count, spp=16, shape=(80, 96, 3)):
        for seed in range(count):
            noise = np.random.default_rng([63, seed]).uniform(-1, 1, shape)
            yield (0.5 + 0.4 * noise / np.sqrt(spp)).astype(np.float32)

    def test_stops_are_those_of_a_session_that_waits(self):
        for running in (False, True):
            plain, session = [nf.Session(96, 80, params=PARAMS, linear=True) for _ in range(2)]
            came, total = [], np.zeros((80, 96, 3))
            background = nf.Background(session, waiting=3)
            self.assertEqual(background.spp_left, 400)
            for k, image in enumerate(self.passes(26)):
                total += image
                if running:
                    image = (total / (k + 1)).astype(np.float32)
                    plain.push_running_image(16 * (k + 1), image)
                    background.push_running_image(16 * (k + 1), image)
                else:
                    plain.push_image(16, image)
                    if k % 2:
                        background.push_image(16, image)
                    else:
                        for request in nf.Session(96, 80, params=PARAMS).requests():
                            background.push(request.tile, 16, image[request.tile.slices])
                plain.judge()
                came += background.judge()
                image[:] = np.nan  # it was copied
            came += background.finish()
            self.assertEqual(
                (background.pending, background.next_pass, background.requests(), background.spp_left), (0, None, [], 0)
            )
            self.assertTrue(plain.done and background.done)
            with self.assertRaisesRegex(nf.Error, r"Background.end\(\)"):
                session.judge()
            with self.assertRaisesRegex(nf.Error, r"Background.end\(\)"):
                nf.Background(session)
            self.assertIs(background.end(), session)
            self.assertEqual(session.stops(), plain.stops())
            order = lambda stop: stop.tile.index
            self.assertEqual(sorted(came, key=order), sorted(plain.stops(), key=order))
            # Samples that came after their tile had stopped are in the picture
            self.assertTrue((session.spp() == 26 * 16).all() and (plain.spp() < 26 * 16).any())
            with self.assertRaisesRegex(nf.Error, "given back"):
                background.push_running_image(1000, np.zeros((80, 96, 3), np.float32))

    def test_it_ends_while_another_thread_hands_over(self):
        session = nf.Session(96, 80, params=nf.Params(tile=32, max_spp=10**9), linear=True)
        background = nf.Background(session, waiting=1)
        begun = threading.Event()

        def render():
            for image in self.passes(10**6, spp=1):
                background.push_image(1, image)
                background.judge()
                begun.set()

        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            renderer = pool.submit(render)
            self.assertTrue(begun.wait(60))
            self.assertIs(background.end(), session)
        with self.assertRaisesRegex(nf.Error, "given back"):
            renderer.result()
        self.assertTrue((session.spp() > 0).all())

    def test_it_ends_with_its_block(self):
        session = nf.Session(96, 80, params=PARAMS)
        with nf.Background(session, when_full="merge") as background:
            for image in self.passes(4):
                background.push_image(background.next_pass, image)
                background.judge()
        self.assertTrue((session.spp() > 0).all())
        with self.assertRaisesRegex(KeyError, "mine"):
            with nf.Background(session) as background:
                raise KeyError("mine")
        self.assertFalse(session.done)
        with self.assertRaisesRegex(nf.ParameterError, "when_full"):
            nf.Background(session, when_full="drop")
        session.judge()

    def test_errors_come_later(self):
        session = nf.Session(96, 80, params=PARAMS)
        background = nf.Background(session)
        background.push_image(16, np.full((80, 96, 3), np.nan, np.float32))
        # Whichever call comes first after the worker has judged.
        with self.assertRaises(nf.FaultError):
            background.judge()
            background.finish()
        with self.assertRaises(nf.FaultError):
            background.end()
        self.assertEqual(session.requests()[0].first, 0)

    def test_a_denoiser_runs_in_the_background_and_its_exceptions_come_back(self):
        def broken(radiance):
            raise ZeroDivisionError("no light")

        def fill(background):
            for image in self.passes(8):
                background.push_image(16, image)
                background.judge()

        params = nf.Params(tile=32, schedule="growing", step=48, min_spp=48)
        whole, failing = (
            nf.Background(nf.Session(96, 80, params=params, denoiser=denoiser, linear=True)) for denoiser in (smooth, broken)
        )
        fill(whole)
        whole.finish()
        self.assertIsNotNone(whole.end().jods_lost())
        with self.assertRaises(ZeroDivisionError):
            fill(failing)
        with self.assertRaises(nf.Error):
            failing.finish()
        del failing  # while its thread may wait for the interpreter

    def test_a_script_ends_beside_a_denoiser_as_without(self):
        """The thread is within the denoiser then, and comes back when there is no interpreter any more, or hardly."""
        script = """if True:
            import sys, time, numpy as np, noisefloor as nf
            inside = []
            def slow(radiance):
                inside.append(1)
                time.sleep(0.2)
                return radiance
            session = nf.Session(64, 64, params=nf.Params(tile=32, max_spp=10_000), denoiser=slow, linear=True)
            background = nf.Background(session)
            random = np.random.default_rng(1)
            for _ in range(3):
                background.push_image(64, random.uniform(0, 1, (64, 64, 3)).astype(np.float32))
                background.judge()
            while not inside:
                time.sleep(0.01)
            """
        for end, code, said in (("", 0, ""), ("sys.exit(3)", 3, ""), ("raise ValueError('mine')", 1, "ValueError: mine")):
            with self.subTest(end):
                ended = subprocess.run([sys.executable, "-c", script + end], capture_output=True, text=True)
                self.assertEqual((ended.returncode, ended.stderr.strip().split("\n")[-1]), (code, said))
                self.assertNotIn("panicked", ended.stderr)

    @unittest.skipUnless(hasattr(os, "fork"), "no fork")
    def test_a_process_that_was_forked_off_is_refused(self):
        background = nf.Background(nf.Session(96, 80, params=PARAMS))

        def work():
            with self.assertRaisesRegex(nf.Error, "forked"):
                background.judge()

        self.assertEqual(in_child(work), 0)
        background.end()


class Lying:
    """An array on a device, by DLPack's number of its kind."""

    def __init__(self, device):
        self.device = device

    def __dlpack_device__(self):
        return (self.device, 0)


class OnDevices(Test):
    """Arrays as frameworks for GPUs have them. What they hold lies here, as no device is needed to say so."""

    IMAGE = np.random.default_rng(63).uniform(0.1, 1, (32, 48, 3)).astype(np.float32)

    def pushed(self, array):
        session = nf.Session(48, 32, params=nf.Params(tile=16))
        session.push_image(8, array)
        return session.image()

    def test_arrays_in_memory_are_read_where_they_lie(self):
        class Readable(Lying):
            def __dlpack__(self, **options):
                return OnDevices.IMAGE.__dlpack__()

        for device in (1, 3):  # the processor's, and what CUDA has pinned: numpy of today knows the first
            with self.subTest(device=device):
                if device == 3:
                    Readable.__array__ = lambda self, *a, **k: OnDevices.IMAGE
                np.testing.assert_array_equal(self.pushed(Readable(device)), self.IMAGE)

    def test_arrays_on_a_device_are_copied_as_their_framework_does(self):
        class Device(Lying):
            """Refuses what numpy tries, as CuPy and PyTorch do."""

            def __array__(self, *arguments, **options):
                raise TypeError("implicit conversion to a NumPy array is not allowed")

        class CuPy(Device):
            __cuda_array_interface__ = {"shape": (32, 48, 3), "typestr": "<f4", "data": (64, True), "version": 3}

            def get(self):
                return OnDevices.IMAGE

        class Torch(Device):
            def cpu(self):
                return OnDevices.IMAGE

        class DrJit:
            __cuda_array_interface__ = CuPy.__cuda_array_interface__

            def __array__(self, *arguments, **options):
                return OnDevices.IMAGE

        for array in (CuPy(2), Torch(2), DrJit()):
            with self.subTest(kind=type(array).__name__):
                np.testing.assert_array_equal(self.pushed(array), self.IMAGE)

        class Broken(CuPy):
            def get(self):
                raise RuntimeError("out of memory")

        with self.assertRaisesRegex(nf.SizeError, "out of memory"):
            self.pushed(Broken(2))

        class Interrupted(Lying):
            """Ctrl-C, while the framework works: as it lies here, and on a device."""

            def __dlpack__(self, **options):
                raise KeyboardInterrupt

        for device in (1, 2):
            self.assertRaises(KeyboardInterrupt, self.pushed, Interrupted(device))


class Faults(Test):
    """Wrong samples are an error or a warning."""

    def feed(self, batches, picture, session=None):
        session = session or self.session()
        for count in range(batches):
            session.push_image(10, picture(count))
            session.judge()
        return session

    def session(self, **options):
        return nf.Session(128, 128, params=nf.Params(tile=64, min_spp=0, max_spp=10_000), **options)

    def independent(self, count):
        light = np.random.default_rng(count).exponential(1.0, (128, 128, 1)) ** 2
        return np.broadcast_to(0.3 * light, (128, 128, 3)).astype(np.float32)

    def test_certain_faults_are_errors(self):
        self.fail_as_said([
            (nf.FaultError, "same batch twice", lambda: self.feed(12, lambda count: self.independent(count // 2))),
            (nf.FaultError, "not finite", lambda: self.feed(12, lambda count: self.independent(count) * np.nan)),
        ])

    def test_what_values_are_is_asked_where_nothing_tells(self):
        def dim(count):
            return 0.5 * np.tanh(self.independent(count))

        with self.assertWarnsRegex(UserWarning, "say so once"):
            self.feed(8, dim)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.feed(8, dim, self.session(linear=True))

    def test_what_is_likely_is_warned_of_once(self):
        def blurred(count):
            image = self.independent(count)
            return (image + np.roll(image, 1, axis=1) + np.roll(image, -1, axis=1)) / 3

        with self.assertWarnsRegex(UserWarning, "neighbouring pixels") as caught:
            session = self.feed(8, blurred, self.session(linear=True))
        self.assertEqual(len(caught.warnings), 1)
        self.assertEqual(len(session.warnings), 1)
        # Who resumes it may not have heard
        path, resumed = self.folder() / "checkpoint", self.session(linear=True)
        session.save(path, "a job")
        resumed.resume(path, "a job")
        with self.assertWarnsRegex(UserWarning, "neighbouring pixels"):
            resumed.judge()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            shared = self.session(shared_pixels=True, linear=True)
            # Neither pickle nor a file forgets it
            shared.save(path, "a job")
            shared.resume(path, "a job")
            for session in (copy.copy(shared), shared):
                self.assertEqual(self.feed(8, blurred, session).warnings, [])
            right = self.feed(8, self.independent, self.session(linear=True))
        self.assertEqual((right.warnings, right.rejected_samples, right.negative_samples), ([], 0, 0))

    def test_samples_that_are_left_out_or_negative_are_counted(self):
        def holes(count):
            image = self.independent(count)
            image[0, :7] = np.nan
            image[1, :5] = -1e-3
            return image

        session = self.feed(4, holes, self.session(linear=True))
        self.assertEqual((session.rejected_samples, session.negative_samples), (280, 200))

    def test_renderers_are_checked(self):
        def right(tile, first, spp):
            mean = np.zeros((tile.height, tile.width, 3), np.float32)
            for sample in range(first, first + spp):
                mean += np.random.default_rng([tile.index, sample]).uniform(0, 1, mean.shape) / spp
            return mean

        nf.check(right)
        nf.check(right, repeats_samples=True)
        again = lambda tile, first, spp: right(tile, first // (2 * spp) * (2 * spp), spp)
        self.fail_as_said([
            (nf.FaultError, "correlated", lambda: nf.check(again)),
            (nf.FaultError, r"shape \(1, 1, 3\)", lambda: nf.check(lambda *_: np.zeros((1, 1, 3)))),
            (ZeroDivisionError, "", lambda: nf.check(lambda *_: 1 // 0)),
        ])


class Denoised(Test):
    """Tiles stop by what a function of Python makes of the samples."""

    SIZE = (64, 96)

    def session(self, denoiser, **options):
        params = nf.Params(tile=32, schedule="growing", step=16, min_spp=16, max_spp=500, tone_mapping="srgb")
        return nf.Session(96, 64, params=params, denoiser=denoiser, linear=True, **options)

    def test_tiles_stop_by_the_denoised_picture(self):
        calls, stops = [], []
        identity = lambda radiance: calls.append(radiance.shape) or radiance
        for denoiser in (smooth, identity):
            session = self.session(denoiser)
            stops.append(finish(session))
            self.assertEqual(session.jods_lost().shape, self.SIZE)
            converged = all(stop.reason == "converged" for stop in stops[-1])
            self.assertEqual(converged, bool((session.jods_lost() <= 0.3).all()))
            self.assertIsNone(session.visible_noise())
        # Nine by nine pixels have a ninth of the noise
        self.assertLess(max(stop.spp for stop in stops[0]), min(stop.spp for stop in stops[1]))
        # Two halves for each verdict, whole
        self.assertEqual(set(calls), {(*self.SIZE, 3)})
        self.assertEqual(len(calls) % 2, 0)
        self.assertIsNone(nf.Session(64, 64).jods_lost())

    def test_the_loss_is_that_of_two_pictures(self):
        """By excess(), which has no session, for one tile as large as its squares."""
        random = np.random.default_rng(3)
        noise = lambda: (0.4 + 0.05 * random.standard_normal((64, 64, 3))).astype(np.float32)
        a, b = noise(), noise()
        params = nf.Params(tile=64, schedule="every", step=16, min_spp=32, max_spp=32, tone_mapping="srgb")
        session = nf.Session(64, 64, params=params, denoiser=smooth)
        for half in (a, b):
            session.push(0, 16, half)
        session.judge()
        excess = nf.excess(a, b, denoised=(smooth(a), smooth(b)), params=params)
        self.assertAlmostEqual(float(session.jods_lost()[0, 0]) * 1.5, 0.3 * excess.ratio, places=4)

    def test_albedo_and_normals_are_passed_on(self):
        hits = [[np.full((*self.SIZE, 3), value, dtype=np.float32) for value in pair] for pair in ((1, 2), (3, 4))]
        seen = []

        def denoiser(radiance, albedo, normal):
            seen.append((float(albedo[0, 0, 0]), float(normal[0, 0, 0])))
            return np.full_like(radiance, 0.5)

        finish(self.session(denoiser, first_hits=hits))
        self.assertEqual(seen, [(1.0, 2.0), (3.0, 4.0)] * (len(seen) // 2))
        small = [[np.zeros((2, 2, 3), np.float32)] * 2] * 2
        self.fail_as_said([
            (nf.SizeError, "first_hits", lambda: self.session(denoiser, first_hits=small)),
            (nf.ParameterError, "denoiser", lambda: nf.Session(96, 64, first_hits=hits)),
        ])

    def test_the_mean_of_mirror_images_is_taken(self):
        def smear(radiance, albedo=None, normal=None):
            made = radiance.copy()
            for x in range(1, made.shape[1]):
                made[:, x] = 0.5 * (made[:, x] + made[:, x - 1])
            return made if albedo is None else made + albedo - normal

        picture = np.random.default_rng(5).uniform(0, 1, (24, 40, 3)).astype(np.float32)
        made = nf.mirror_mean(smear, picture)
        expected = 0.5 * (smear(picture) + smear(picture[:, ::-1])[:, ::-1])
        np.testing.assert_allclose(made, expected, atol=1e-6)
        np.testing.assert_array_equal(nf.mirror_mean(smear, picture, passes=1), smear(picture))
        # Albedo and normals are mirrored with the picture
        guided = nf.mirror_mean(smear, picture, picture, np.zeros_like(picture))
        np.testing.assert_allclose(guided, made + picture, atol=1e-6)

        def fails(radiance):
            raise KeyError("out of order")

        # A session is told, and remembers where it goes
        pickle.loads(pickle.dumps(self.session(smooth, passes=4)))
        self.fail_as_said([
            (nf.ParameterError, "1 or 4", lambda: nf.mirror_mean(smear, picture, passes=3)),
            (nf.ParameterError, "normal", lambda: nf.mirror_mean(smear, picture, picture)),
            (nf.SizeError, "", lambda: nf.mirror_mean(smear, picture, picture, picture[1:])),
            (nf.SizeError, "", lambda: nf.mirror_mean(lambda radiance: radiance[1:], picture)),
            (KeyError, "out of order", lambda: nf.mirror_mean(fails, picture)),
            (nf.ParameterError, "denoiser", lambda: nf.mirror_mean(3, picture)),
            (nf.ParameterError, "1 or 4", lambda: self.session(smooth, passes=2)),
        ])

    def test_first_hits_are_clean_where_halves_agree(self):
        noise = np.random.default_rng(6)
        flat = np.full((64, 96, 3), 0.5, np.float32)
        half = lambda deviation: [flat + noise.normal(0, deviation, flat.shape).astype(np.float32)] * 2
        self.assertTrue(nf.first_hits_are_clean([half(0.01), half(0.01)]))
        self.assertFalse(nf.first_hits_are_clean([half(0.03), half(0.03)]))
        with self.assertRaises(nf.SizeError):
            nf.first_hits_are_clean([[flat, flat], [flat, flat[1:]]])

    def test_what_a_denoiser_does_wrong_is_said(self):
        def fails(radiance):
            raise KeyError("no weights")

        sessions = []
        cases = [
            (fails, KeyError, "no weights"),
            (lambda radiance: radiance[1:], nf.SizeError, "denoiser: an array has shape"),
            (lambda radiance: radiance * np.nan, nf.ParameterError, "finite"),
            (lambda radiance: None, nf.SizeError, "."),
            (lambda radiance: sessions[-1].image(), nf.Error, "waits for it"),
        ]
        for denoiser, error, text in cases:
            sessions.append(self.session(denoiser))
            with self.assertRaisesRegex(error, text):
                finish(sessions[-1])
            # It is as it was: nothing is lost
            self.assertEqual(sessions[-1].open_tiles, 6)
        for wrong in (dict(denoiser=smooth, oracle=nf.Oracle()), dict(denoiser=3), dict(denoiser=smooth, lost=0)):
            with self.assertRaises(nf.ParameterError):
                nf.Session(96, 64, **wrong)

    def test_it_is_resumed_and_pickled(self):
        session, path = self.session(smooth), self.folder() / "checkpoint"
        finish(session, verdicts=1)
        session.save(path, "a wall")
        pickled, resumed = pickle.loads(pickle.dumps(session)), self.session(smooth)
        resumed.resume(path, "a wall")
        # More may be asked for, and not less
        self.session(smooth, lost=0.2).resume(path, "a wall")
        with self.assertRaises(nf.CheckpointError):
            self.session(smooth, lost=0.4).resume(path, "a wall")
        lost, whole = session.jods_lost(), finish(self.session(smooth))
        for again in (pickled, resumed):
            np.testing.assert_array_equal(again.jods_lost(), lost)
            self.assertEqual(finish(again), whole)


class Errors(Test):
    def test_every_error_is_typed_and_says_what_is_wrong(self):
        session = nf.Session(96, 80, params=PARAMS)
        black = np.zeros((EDGE, EDGE, 3), np.float32)
        bytes_of = np.zeros((EDGE, EDGE, 3), np.uint8)
        void = black.view("V4")  # the kind of bfloat16, as ml_dtypes has it
        elsewhere = nf.Session(200, 80, params=PARAMS).requests()[4].tile
        self.fail_as_said([
            (nf.SizeError, r"\(16, 32, 3\), and tile 0 is \(32, 32, 3\)", lambda: session.push(0, 1, black[:16])),
            (nf.SizeError, r"\(height, width, 3\) is needed", lambda: session.push(0, 1, black[..., :2])),
            (nf.SizeError, "and the session", lambda: session.push_image(1, black)),
            (nf.SizeError, "0×5", lambda: nf.Session(0, 5)),
            (nf.BatchError, "tile 9 does not exist", lambda: session.push(9, 1, black)),
            (nf.BatchError, "no new samples", lambda: session.push(0, 0, black)),
            (nf.BatchError, "tile 99", lambda: session.verdict(99)),
            (nf.ParameterError, "step of 1", lambda: nf.Params(step=1)),
            (nf.ParameterError, "tone mapping", lambda: nf.Params(tone_mapping="filmic")),
            (nf.ParameterError, "positive finite", lambda: nf.Params(key=float("nan"))),
            (nf.ParameterError, "schedule", lambda: nf.Params(schedule="never")),
            (nf.ParameterError, "moon", lambda: nf.Viewing("moon")),
            (nf.ParameterError, "moon", lambda: nf.Params(viewing="moon")),
            (nf.ParameterError, "frames per second", lambda: nf.Viewing("desk,fps=3")),
            (nf.ParameterError, "exposure of Reinhard", lambda: nf.Params(exposure=0)),
            (nf.ParameterError, "share of people", lambda: nf.Oracle(1.0)),
            (nf.ModelError, "model", lambda: nf.Oracle(model=__file__)),
            (FileNotFoundError, "nowhere", lambda: nf.Oracle(model="/nowhere/at/all")),
            (nf.PictureError, "identical", lambda: nf.judge(black, 8, black, 8)),
            (nf.PictureError, "against: pixel", lambda: nf.judge(black, 8, black * np.nan, 8)),
            (nf.PictureError, "positive number", lambda: nf.judge(black, 0, black + 1, 8)),
            (nf.ParameterError, "nested", lambda: nf.judge(black, 8, black + 1, 8, samples="both")),
            (nf.SizeError, "reference", lambda: nf.metrics(black, black[:16])),
            (nf.PictureError, "not finite", lambda: nf.metrics(black + np.inf, black)),
            (nf.SizeError, r"shape \(32, 32\); \(height, width, 3\)", lambda: session.push(0, 1, black[..., 0])),
            (nf.SizeError, r"shape \(\)", lambda: nf.judge(3.0, 8, black, 8)),
            (nf.ParameterError, "-3 is out of range", lambda: session.push(0, -3, black)),
            (nf.ParameterError, "-5 is out of range", lambda: session.push_running(0, -5, black)),
            (nf.ParameterError, "-8 is out of range", lambda: nf.Session(-8, 8)),
            (nf.ParameterError, "out of range", lambda: nf.Params(max_spp=2**64)),
            (nf.BatchError, "tile -1 does not exist", lambda: session.push(-1, 1, black)),
            (nf.BatchError, "of another session: here it is", lambda: session.push(elsewhere, 1, black)),
            (nf.PictureError, "dtype uint8 are no radiance", lambda: session.push(0, 1, bytes_of)),
            (nf.PictureError, "masked", lambda: session.push(0, 1, np.ma.masked_less(np.zeros((EDGE, EDGE, 3)), 1))),
            (nf.PictureError, r'dtype void32 are no floats.*astype\("float32"\)', lambda: session.push(0, 1, void)),
            (nf.PictureError, "dtype int64", lambda: session.push(0, 1, bytes_of.astype(int))),
            (nf.PictureError, "dtype uint8", lambda: nf.metrics(bytes_of, bytes_of)),
            (nf.PictureError, "dtype uint8", lambda: nf.judge(bytes_of, 8, bytes_of, 8)),
            (nf.PictureError, "dtype <U5|dtype str", lambda: nf.metrics([[["black"] * 3]], black)),
            (nf.PictureError, "1.5 is not sRGB", lambda: nf.metrics(black + 1.5, black, encoding="srgb")),
            (nf.ParameterError, "no encoding", lambda: nf.metrics(black, black, encoding="rec709")),
            (nf.ParameterError, "converged", lambda: session.close_all("converged")),
            (TypeError, "", lambda: session.push("0", 1, black)),
            (TypeError, "", lambda: nf.Session("8", 8)),
            (TypeError, "", lambda: session.push(0, 1.5, black)),
        ])
        for name in ("Parameter", "Size", "Batch", "Model", "Criterion", "Checkpoint", "Picture"):
            self.assertTrue(issubclass(getattr(nf, name + "Error"), nf.Error))

    def test_values_are_written_as_python_reads_them(self):
        for params in (nf.Params(), nf.Params(tone_mapping="srgb", exposure=2.5, schedule="every"),
                       nf.Params(white=3.0, audience=(0.5, 2.25), viewing="tv,distance=2")):
            self.assertEqual(eval(repr(params), vars(nf)), params)


class Pictures(Test):
    def test_little_noise_is_not_seen_and_much_is(self):
        params = nf.Params(tile=64)
        seen = nf.judge(noisy(1, 20), 20, noisy(2, 20), 20, samples="independent", params=params)
        clean = nf.judge(noisy(1, 1e7), 1e7, noisy(2, 1e7), 1e7, samples="independent", params=params)
        self.assertEqual([verdict.converged for verdict in seen.verdicts], [False, False])
        self.assertEqual([verdict.converged for verdict in clean.verdicts], [True, True])
        self.assertGreater(clean.verdicts[0].probability, seen.verdicts[0].probability)
        self.assertGreater(seen.verdicts[0].expected_spp, 20)
        self.assertEqual(seen.samples, "independent")
        shown = [np.uint8(np.clip(noisy(seed, 20), 0, 1) ** (1 / 2.2) * 255) for seed in (1, 2)]
        shown = nf.judge(shown[0], 20, shown[1], 20, samples="independent", params=params, encoding="srgb")
        self.assertEqual([verdict.converged for verdict in shown.verdicts], [False, False])
        self.assertEqual(seen.warnings, [])
        noise = seen.visible_noise()
        self.assertEqual((noise.shape, noise.dtype), ((64, 96), np.float32))

    def test_pictures_that_do_not_belong_together_are_warned_of(self):
        """Blurred; and the other with three times the exposure. Each warning is kept by pickle."""
        one, other = noisy(1, 20), noisy(2, 20)
        for word, pair in (("denoised, blurred", (smooth(one), smooth(other))), ("exposure", (one, 3 * other))):
            with self.subTest(word):
                judged = nf.judge(pair[0], 20, pair[1], 20, samples="independent")
                self.assertEqual([word in text for text in judged.warnings], [True])
                self.assertEqual(pickle.loads(pickle.dumps(judged)).warnings, judged.warnings)

    def test_metrics_are_those_of_arithmetic(self):
        image, reference = np.full((16, 12, 3), 0.3), np.full((16, 12, 3), 0.2)
        found = nf.metrics(image, reference, tone_mapping="srgb")
        self.assertAlmostEqual(found.rel_mse, 0.01 / 0.05, places=5)
        encode = lambda linear: 1.055 * linear ** (1 / 2.4) - 0.055
        self.assertAlmostEqual(found.psnr, -20 * np.log10(encode(0.3) - encode(0.2)), places=3)
        # The same by what screens show: in 8 bits, in 16, and in floats
        shown = [np.round(encode(value) * 255) for value in (0.3, 0.2)]
        for dtype, white in ((np.uint8, 1), (np.uint16, 257), (np.float32, 1 / 255)):
            eight = [np.full((16, 12, 3), value * white, dtype) for value in shown]
            seen = nf.metrics(*eight, encoding="srgb")
            self.assertAlmostEqual(seen.psnr, -20 * np.log10((shown[0] - shown[1]) / 255), places=3)
            self.assertLess(seen.rel_mse, 0.21)
        lost = {}
        for viewing in ("desk", "desk,distance=5", "desk,fps=60"):
            found = nf.metrics(noisy(1, 100), noisy(1, 1e8), viewing=nf.Viewing(viewing))
            lost[viewing] = 10 - found.cvvdp_jod
            self.assertEqual(found.cvvdp_map().shape, (64, 96))
        self.assertGreater(lost["desk"], max(0.1, lost["desk,distance=5"], lost["desk,fps=60"] / 0.8))


class Files(Test):
    def test_pictures_come_back_as_they_were_written(self):
        folder = self.folder()
        path = folder / "picture.EXR"
        picture = noisy(1, 20)
        picture[0, 0] = [-3.0, np.inf, 1e30]
        nf.write(path, picture)
        back, encoding = nf.read(path)
        self.assertEqual((back.dtype, encoding), (np.float32, "linear"))
        np.testing.assert_array_equal(back, picture)
        # Every code of 8 bits
        codes = np.arange(256 * 3, dtype=np.uint8).reshape(16, 16, 3)
        nf.write(str(folder / "codes.png"), codes, encoding="srgb")
        back, encoding = nf.read(folder / "codes.png")
        self.assertEqual((back.dtype, encoding), (np.uint8, "srgb"))
        np.testing.assert_array_equal(back, codes)
        # Radiance as screens show it, and back, by the formula of IEC 61966-2-1
        nf.write(folder / "grey.png", np.full((2, 3, 3), 0.2))
        nf.write(folder / "grey.exr", np.full((2, 3, 3), 124, np.uint8), encoding="srgb")
        # 1.055·0.2^(1/2.4) − 0.055 is 123.6/255
        self.assertTrue((nf.read(folder / "grey.png")[0] == 124).all())
        linear = ((124 / 255 + 0.055) / 1.055) ** 2.4
        np.testing.assert_allclose(nf.read(folder / "grey.exr")[0], linear, rtol=1e-5)
        image, encoding = nf.read(folder / "codes.png")
        self.assertEqual(nf.metrics(image, image, encoding=encoding).psnr, np.inf)

    def test_a_png_that_others_wrote_is_read(self):
        """16 bits, by the chunks of the format and zlib alone."""
        codes = np.arange(2 * 3 * 3, dtype=np.uint16).reshape(2, 3, 3) * 3000
        def chunk(name, data):
            return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in codes)
        head = chunk(b"IHDR", struct.pack(">IIBBBBB", 3, 2, 16, 2, 0, 0, 0))
        path = self.folder() / "deep.png"
        body = chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
        path.write_bytes(b"\x89PNG\r\n\x1a\n" + head + body)
        back, encoding = nf.read(path)
        self.assertEqual((back.dtype, encoding), (np.uint16, "srgb"))
        np.testing.assert_array_equal(back, codes)

    def test_files_that_cannot_be_are_errors(self):
        black = np.zeros((4, 4, 3), np.float32)
        at = self.folder()
        foreign, huge, folder = (at / name for name in ("text.exr", "huge.pfm", "folder.exr"))
        folder.mkdir()
        foreign.write_text("no picture")
        huge.write_bytes(b"PF\n65536 65536\n-1\n")
        self.fail_as_said([
            (FileNotFoundError, "nowhere.exr", lambda: nf.read(at / "nowhere.exr")),
            (nf.PictureError, "text.exr", lambda: nf.read(foreign)),
            (nf.PictureError, "65536", lambda: nf.read(huge)),
            (FileNotFoundError, "choose a folder", lambda: nf.write(at / "no/a.exr", black)),
            (OSError, "is a folder", lambda: nf.write(folder, black)),
            (nf.ParameterError, "name the file .exr or .png", lambda: nf.write(at / "a.jpg", black)),
            (nf.PictureError, "dtype uint8", lambda: nf.write(at / "a.png", black.astype(np.uint8))),
            (nf.SizeError, r"\(4, 4, 1\)", lambda: nf.write(at / "a.png", black[..., :1])),
        ])
        left = {path.name for path in at.iterdir()}
        self.assertEqual(left, {"text.exr", "huge.pfm", "folder.exr"})


class Processes(Test):
    def test_a_pool_of_processes_renders(self):
        alone, session = nf.Session(96, 80, params=PARAMS), nf.Session(96, 80, params=PARAMS)
        finish(alone)
        spawn = multiprocessing.get_context("spawn")
        with concurrent.futures.ProcessPoolExecutor(2, mp_context=spawn) as pool:
            while not session.done:
                requests = session.requests()
                for request, mean in zip(requests, pool.map(render, requests)):
                    session.push(request.tile, request.spp, mean)
                session.judge()
            with self.assertRaisesRegex(nf.FaultError, "nothing to render"):
                list(pool.map(render, [nf.Request(alone.stops()[0].tile, 0, 0, 0, 0)]))
        self.assertEqual(session.stops(), alone.stops())
        np.testing.assert_array_equal(session.image(), alone.image())

    def test_what_is_pickled_comes_back_the_same(self):
        session = nf.Session(64, 64, params=nf.Params(tile=EDGE, white=3.3))
        requests = session.requests()
        session.push_image(100, noisy(1, 100, (64, 64, 3)))
        session.push_image(100, noisy(2, 100, (64, 64, 3)))
        session.judge()
        finish(done := nf.Session(64, 64, params=PARAMS))
        values = [requests[0], requests[0].tile, session.verdict(0), done.stops()[0],
                  nf.Viewing("desk,distance=1.3"), nf.Params(white=3.3),
                  nf.Params(tile=64, tone_mapping="srgb", exposure=0.3, audience=(1.5, 2), step=50),
                  nf.Params(exposure=1.3, white=3, viewing="desk,fps=24")]
        for value in values:
            for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
                self.assertEqual(pickle.loads(pickle.dumps(value, protocol)), value)
            self.assertIsNot(copy.copy(value), value)
        self.assertEqual([nf.Viewing(seen).frames_per_second for seen in ("desk", "desk,fps=24")], [None, 24])
        self.assertNotEqual(values[0], requests[1])
        self.assertEqual(len(set(requests + pickle.loads(pickle.dumps(requests)))), len(requests))
        oracle = pickle.loads(pickle.dumps(nf.Oracle(0.8)))
        self.assertEqual((oracle.people, oracle.digest), (np.float32(0.8), nf.Oracle().digest))

    def test_results_are_pickled(self):
        judged = nf.judge(noisy(1, 20), 20, noisy(2, 20), 20, samples="independent")
        back = pickle.loads(pickle.dumps(judged))
        self.assertEqual((back.verdicts, back.samples), (judged.verdicts, "independent"))
        np.testing.assert_array_equal(back.visible_noise(), judged.visible_noise())
        found = nf.metrics(noisy(1, 100), noisy(1, 1e8))
        back = pickle.loads(pickle.dumps(found))
        for name in ("cvvdp_jod", "psnr", "rel_mse", "flip", "butteraugli"):
            self.assertEqual(getattr(back, name), getattr(found, name))
        np.testing.assert_array_equal(back.cvvdp_map(), found.cvvdp_map())
        np.testing.assert_array_equal(back.flip_map(), found.flip_map())


class Documentation(Test):
    def test_everything_public_has_a_docstring(self):
        for name in nf.__all__:
            thing = getattr(nf, name)
            self.assertTrue(thing.__doc__, name)
            members = vars(thing).items() if inspect.isclass(thing) else ()
            for member, value in members:
                if not member.startswith("_"):
                    self.assertTrue(value.__doc__, f"{name}.{member}")

    def test_the_stubs_have_what_the_module_has(self):
        stub = pathlib.Path(nf.__file__).with_name("_noisefloor.pyi")
        declared = {node.name: node for node in ast.parse(stub.read_text()).body
                    if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(set(declared), set(nf.__all__))
        for name, node in declared.items():
            thing = getattr(nf, name)
            functions = [node] if isinstance(node, ast.FunctionDef) else [
                part for part in node.body if isinstance(part, ast.FunctionDef)]
            if isinstance(node, ast.ClassDef) and not issubclass(thing, Exception):
                public = {member for member in vars(thing) if not member.startswith("_")}
                stubbed = {part.name for part in functions if not part.name.startswith("_")}
                self.assertEqual(stubbed, public, name)
            for function in functions:
                real = thing if isinstance(node, ast.FunctionDef) else getattr(thing, function.name)
                if function.name == "__new__":
                    real = thing
                elif function.name.startswith("__") or not callable(real):
                    continue
                arguments = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
                names = [argument.arg for argument in arguments if argument.arg != "cls"]
                signature = [p for p in inspect.signature(real).parameters]
                self.assertEqual([n for n in names if n != "self"], [p for p in signature if p != "self"],
                                 f"{name}.{function.name}")


@unittest.skipUnless(hasattr(os, "fork"), "there is no fork")
class Forks(Test):
    def test_children_judge_as_their_parents_do_also_beside_threads_that_judge(self):
        pair = noisy(1, 64), 64, noisy(2, 64), 64
        judge = lambda: nf.judge(*pair, samples="independent", params=PARAMS).verdicts
        stops, right = finish(nf.Session(96, 80, params=PARAMS)), judge()

        def work():
            self.assertEqual(judge(), right)
            self.assertEqual(finish(nf.Session(96, 80, params=PARAMS)), stops)
            # And a child of the child
            self.assertEqual(in_child(lambda: self.assertEqual(judge(), right)), 0)

        for threads in (0, 3):
            with beside(judge, threads):
                self.assertEqual([in_child(work) for _ in range(5)], [0] * 5)
        self.assertEqual(judge(), right)


class Settings(Test):
    """The search for a renderer's own setting, and tables of what screens show."""

    @staticmethod
    def noisy(seed, sigma, size=128):
        draw = np.random.default_rng(seed)
        return np.float32(0.4 + sigma * draw.standard_normal((size, size, 3)))

    def test_pictures_that_are_unlike_each_other_are_noticed(self):
        one, other = self.noisy(1, 2e-4), self.noisy(2, 2e-4)
        nf.excess(one, other)
        with self.assertWarnsRegex(UserWarning, "times as bright"):
            nf.excess(one, 1.5 * other)
        for unlike, words in ((5 * other, "differ in brightness"), (other - 1, "negative")):
            with self.assertRaisesRegex(nf.PictureError, words):
                nf.excess(one - 1 if words == "negative" else one, unlike)
            with self.assertRaisesRegex(nf.PictureError, words):
                nf.judge(one - 1 if words == "negative" else one, 64, unlike, 64, samples="independent")

    def test_what_was_not_asked_for_is_not_told(self):
        search = nf.Search(threshold=(0.2, 0.001))
        with self.assertRaisesRegex(nf.ParameterError, "once"):
            search.tell(1.0)
        for wrong in (float("nan"), -1.0):
            search.next()
            with self.assertRaisesRegex(nf.ParameterError, "0 or more"):
                search.tell(wrong)
            with self.assertRaisesRegex(nf.ParameterError, "alone"):
                search.tell(2.0, alone=wrong)
        self.assertEqual(search.steps, [])
        search.next()
        search.tell(5.0)
        with self.assertRaisesRegex(nf.ParameterError, "once"):
            search.tell(5.0)
        each = search.next().each
        search.tell(0.0)
        self.assertEqual((search.ending, search.setting), ("found", each))
        with self.assertRaisesRegex(nf.ParameterError, "end"):
            search.tell(1.0)

    def test_crops_of_a_large_picture_are_asked_for(self):
        params = nf.Params(tone_mapping="srgb")
        alone = nf.excess(*(self.noisy(seed, 0.02) for seed in (1, 2)), params=params)
        self.assertAlmostEqual(alone.map().max(), alone.ratio, places=5)
        search, looks = nf.Search(threshold=(0.05, 0.0001), views=2, size=(512, 256)), []
        for look in search:
            looks.append(look)
            self.assertIsNone(search.ending)
            self.assertEqual((search.next().each, search.next().crop), (look.each, look.crop))
            with self.assertRaisesRegex(nf.ParameterError, "tell"):
                next(search)
            width, height = look.crop[2:] if look.crop else (512, 256)
            pair = (np.float32(0.4 + look.each * np.random.default_rng(seed).standard_normal((height, width, 3))) for seed in (1, 2))
            search.tell(nf.excess(*pair, params=params))
        self.assertEqual((search.ending, sorted(search.views), list(search)), ("found", [0, 1], []))
        crops = [look for look in looks if look.crop]
        self.assertTrue(crops[0].is_rendered and {look.crop[2:] for look in crops} == {(128, 128)}, crops)
        self.assertTrue({look.view for look in looks if not look.crop} == {0, 1} and search.steps[-1][1] <= 1)

    def test_denoised_pictures_are_judged_by_what_they_have_lost(self):
        pair, params = (self.noisy(1, 0.2), self.noisy(2, 0.2)), nf.Params(tone_mapping="srgb")
        denoised = tuple(map(smooth, pair))
        half = nf.excess(*pair, params=params, denoised=denoised, lost=0.6)
        for found in (half, nf.excess(*pair, params=params)):
            squares = found.squares()
            self.assertEqual(found.map().shape, (128, 128))
            self.assertAlmostEqual(max(ratio for *_, ratio in squares), found.ratio, places=5)
            self.assertEqual({(width, height) for _, _, width, height, _ in squares}, {(64, 64)})
            x, y = found.place
            worst = max(squares, key=lambda square: square[-1])
            self.assertTrue(worst[0] <= x < worst[0] + 64 and worst[1] <= y < worst[1] + 64, (found.place, worst))
        self.assertAlmostEqual(half.ratio, nf.excess(*pair, params=params, denoised=denoised).ratio / 2)

    def test_counts_of_samples_say_what_one_picture_leaves(self):
        def excess(samples, limits=(16, 32, 64)):
            counts = None if samples is None else (*[np.full((128, 128), samples)] * 2, *limits)
            return nf.excess(*pair, params=nf.Params(tone_mapping="srgb"), counts=counts)

        # Of two pictures with this noise, the mean is good enough, and neither alone
        pair = self.noisy(1, 0.02), self.noisy(2, 0.02)
        pair = [self.noisy(seed, 0.85 * 0.02 / excess(None).ratio) for seed in (1, 2)]
        endings = {}
        for samples in (None, 16, 64):
            search = nf.Search(threshold=(0.2, 0.001))
            search.next()
            search.tell(excess(samples))
            endings[samples] = search.ending
        self.assertEqual(endings, {None: None, 16: "found", 64: "capped"})
        with self.assertRaises(nf.SizeError):
            nf.excess(*pair, counts=(np.ones((64, 128)), np.ones((64, 128)), 1, 1, 1))
        for wrong in ((40, (0, 32, 64)), (float("nan"), (16, 32, 64))):
            with self.assertRaisesRegex(nf.ParameterError, "counts"):
                excess(*wrong)

    def test_ends_are_told_and_nonsense_is_refused(self):
        search = nf.Search(samples=(16, 64))
        for look in search:
            search.tell(100.0, alone=100.0)
        self.assertEqual((search.ending, search.setting), ("at-finest", None))
        for bad in ({}, {"samples": (16, 4)}, {"threshold": (0.1, 0.2)}, {"samples": (3, 3)}, {"threshold": (1e308, 1e-308)}, {"samples": (2, 4), "threshold": (1, 0.1)}):
            with self.assertRaises(nf.ParameterError):
                nf.Search(**bad)
        picture = self.noisy(1, 0.1)
        self.fail_as_said([
            (nf.PictureError, "identical", lambda: nf.excess(picture, picture)),
            (nf.SizeError, "different sizes", lambda: nf.excess(picture, picture[:64])),
            (nf.ParameterError, "positive number of JOD", lambda: nf.excess(picture, self.noisy(2, 0.1), lost=-1)),
        ])

    def test_a_table_shows_what_it_says(self):
        # Plain sRGB at half the exposure, as a table: the verdicts of plain sRGB, but for what lies between entries
        axis = nf.ToneTable.radiances(65, 0.001, 10)
        shown = np.minimum(axis / 2, 1)
        shown = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
        blue, green, red = np.meshgrid(shown, shown, shown, indexing="ij")
        table = nf.ToneTable(np.stack([red, green, blue], -1), 0.001, 10)
        pair = self.noisy(1, 0.05), self.noisy(2, 0.05)
        ratio = {
            name: nf.excess(*pair, params=nf.Params(**tone)).ratio
            for name, tone in {
                "table": {"tone_mapping": table},
                "plain": {"tone_mapping": "srgb", "exposure": 0.5},
                "brighter": {"tone_mapping": "srgb", "exposure": 2.0},
            }.items()
        }
        self.assertAlmostEqual(ratio["table"] / ratio["plain"], 1, delta=0.02)
        self.assertNotAlmostEqual(ratio["brighter"] / ratio["plain"], 1, delta=0.06)
        params = nf.Params(tone_mapping=table, exposure=0.5)
        again = pickle.loads(pickle.dumps(params))
        self.assertEqual(again, params)
        self.assertNotEqual(again, nf.Params(tone_mapping=table))
        self.assertEqual(pickle.loads(pickle.dumps(table)), table)
        for bad, error in [
            (np.zeros((33, 33, 33)), nf.SizeError),
            (np.zeros((3, 4, 3, 3)), nf.SizeError),
            (np.zeros((66, 66, 66, 3)), nf.ParameterError),
            (np.full((2, 2, 2, 3), np.nan), nf.ParameterError),
            (np.full((2, 2, 2, 3), 255.0), nf.ParameterError),
            (np.full((2, 2, 2, 3), 255, np.uint8), nf.PictureError),
            (np.full((2, 2, 2, 3), 1), nf.PictureError),
        ]:
            with self.assertRaises(error):
                nf.ToneTable(bad)

    def test_a_file_of_a_lut_shows_what_it_says(self):
        """Red and blue exchanged."""
        pair, folder = (self.noisy(1, 0.05), self.noisy(2, 0.05)), self.folder()
        cube, broken = folder / "swap.cube", folder / "broken.cube"
        corners = [(r, g, b) for b in (0, 1) for g in (0, 1) for r in (0, 1)]
        cube.write_text("LUT_3D_SIZE 2\n" + "".join(f"{b} {g} {r}\n" for r, g, b in corners))
        broken.write_text("LUT_3D_SIZE 2\n0 0 0\n")
        linear, swap = nf.Lut(cube), nf.Lut(cube, "srgb")
        self.fail_as_said([
            (nf.PictureError, "", lambda: nf.Lut(broken)),
            (nf.ParameterError, "", lambda: nf.Lut(cube, "log3")),
            (FileNotFoundError, "none.cube", lambda: nf.Lut("none.cube")),
        ])
        # The file is not needed any more
        cube.unlink()
        ratio = lambda tone, pair=pair: nf.excess(*pair, params=nf.Params(tone_mapping=tone)).ratio
        exchanged = [picture[..., ::-1] for picture in pair]
        self.assertAlmostEqual(ratio(swap) / ratio("srgb", exchanged), 1, delta=1e-4)
        self.assertNotAlmostEqual(ratio(swap) / ratio("srgb"), 1, delta=1e-3)
        for tone in (linear, swap):
            self.assertEqual(pickle.loads(pickle.dumps(tone)), tone)
            params = nf.Params(tone_mapping=tone)
            self.assertEqual(pickle.loads(pickle.dumps(params)), params)
        self.assertNotEqual(linear, swap)


if __name__ == "__main__":
    unittest.main()
