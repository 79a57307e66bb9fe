"""Serves LuxCore (pyluxcore) to noisefloor-luxcore.

Scenes are LuxCore's own: a configuration (.cfg) that names a scene, or a scene (.scn) by itself. Options:

- engine: "path" or "bidir", which LuxCore calls PATHCPU and BIDIRCPU;
- sampler: "random", "sobol" or "metropolis".

How batches stay independent differs. A session of the random and the Sobol sampler costs little but for the tree over the
scene's triangles, so every call starts new ones, with seeds never used before: no stream of random numbers goes on, none
repeats, and a Sobol pattern ends with its batch. A Markov chain must not be cut: the Metropolis sampler gets two sessions a
tile that live as long as this process, paused between batches, and a batch continues the one with fewer mutations. That is
how noisefloor's film fills its two halves, so that each half holds one chain.
"""

import hashlib
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import host

ENGINES = {"path": "PATHCPU", "bidir": "BIDIRCPU"}
# Where a GPU traces paths; from both ends, none can
ON_GPU = "PATHOCL"
SAMPLERS = {"random": "RANDOM", "sobol": "SOBOL", "metropolis": "METROPOLIS"}
# What a configuration may say that would stop a session, alter its samples, or cost time for nothing
REMOVED = ["batch.", "periodicsave.", "resumerendering.", "film.outputs.", "film.imagepipeline", "film.subregion"]
# What makes batches alike, because sessions share what they have guessed of the light
CACHES = ["path.photongi.indirect.enabled", "path.photongi.caustic.enabled"]
FORCED = {
    # Every sample counts in only one pixel, and in full
    "film.filter.type": "NONE",
    "path.clamping.variance.maxvalue": 0.0,
    "sampler.random.adaptive.strength": 0.0,
    "sampler.sobol.adaptive.strength": 0.0,
    "path.hybridbackforward.enable": False,
    "film.outputs.0.type": "RGB",
    "film.outputs.0.filename": "unused.exr",
    "film.outputs.1.type": "SAMPLECOUNT",
    "film.outputs.1.filename": "unused.exr",
}
# Settings of the scene that batches are not rendered by, and pictures of `adaptive` are
OWN = ["film.filter.", "path.clamping.", "sampler.random.adaptive.", "sampler.sobol.adaptive.", "path.hybridbackforward."]
# Samples per pixel between two looks at the noise, and before the first: LuxCore's own step is 64, which is more than many
# pictures need
HALT_STEP = 16
# Most samples per pixel of a picture that nobody has bounded
MOST_SPP = 16384
SIDES = ["x", "y", "width", "height"]
# Most seconds between two looks at how far a session is
POLL = 0.01
# Sobol points of a session: batches of any size then have the noise of as many sessions, and no less for being large
SOBOL_BLOCK = 8
# Samples a pixel beyond those asked for that are waited for pixels that have none: LuxCore drops invalid samples
PATIENCE = 4
# Most samples that the threads take, over all pixels of a tile, before they notice that they have to stop: two threads on two
# busy cores took 3,600 (2026-11-22), this is for 64
OVERRUN = 1 << 17


def _root(folder, scene_file):
    """The folder that a configuration's names begin at. For LuxCore that is the working directory; where it does not hold the
    scene, it is the folder of the configuration, or one above, as in LuxCore's own scenes."""
    above = [folder]
    while os.path.dirname(above[-1]) != above[-1]:
        above.append(os.path.dirname(above[-1]))
    roots = [os.getcwd(), *above] if scene_file != os.path.basename(scene_file) else [folder, os.getcwd()]
    found = (root for root in roots if os.path.exists(os.path.join(root, scene_file)))
    return next(found, folder)


class LuxCore:
    def __init__(self, init):
        engine, sampler = (init["options"][name] for name in ("engine", "sampler"))
        # numpy first: pyluxcore crashes if it is the one that loads it
        import numpy
        import pyluxcore

        self.np, self.lux = numpy, pyluxcore
        pyluxcore.Init(lambda message: None)
        self.seed, self.drawn = init["seed"], 0
        self.metropolis, self.sobol = sampler == "metropolis", sampler == "sobol"

        warnings = self._configure(init["scene"], init, engine, sampler)
        there = self.gpus if engine == "path" else lambda: ([], "LuxCore's tracer from both ends has no engine for GPUs")
        gpu = host.pick(init.get("device"), there, warnings)
        if gpu:
            on = {"renderengine.type": ON_GPU, "opencl.native.threads.count": 0, "opencl.devices.select": gpu[2]}
            for key, value in on.items():
                self.config.Set(pyluxcore.Property(key, [value]))
        self.scene = None if self.metropolis else self._scene()
        # Samples a pixel that tiles have been given beyond those said, and the pairs of chains of tiles
        self.surplus, self.chains = {}, {}
        self.info = {
            "name": f"LuxCore {pyluxcore.Version()} ({engine}, {sampler}{f', {gpu[1]}' if gpu else ''})",
            "width": self.width,
            "height": self.height,
            "unit": "mutations-per-pixel" if self.metropolis else "samples-per-pixel",
            "repeats": "nothing",
            "late": OVERRUN,
            "stratified": sampler == "sobol",
            "warnings": warnings,
        }

    @staticmethod
    def gpus():
        import numpy  # noqa: F401
        import pyluxcore

        pyluxcore.Init(lambda message: None)
        there = pyluxcore.GetOpenCLDeviceList()
        found = []
        for number, (name, kind, *_) in enumerate(there):
            # A device is chosen by its place in a row of all
            place = "".join(str(int(other == number)) for other in range(len(there)))
            if kind.endswith("_GPU"):
                found.append((kind.removesuffix("_GPU"), name, place))
        # CUDA before OpenCL, which is the same card, slower
        return sorted(found, key=lambda gpu: gpu[0] != "CUDA"), "LuxCore finds no device of CUDA or OpenCL"

    def sample(self, tiles):
        if self.metropolis:
            return self._continue_chains(tiles)
        return self._in_blocks(tiles) if self.sobol else self._fresh_sessions(tiles)

    def adaptive(self, threshold, samples, seed, part):
        """The picture as LuxCore samples it where there is noise, until its halt condition: no pixel, as displayed, changes
        by more than the threshold between two looks. Not denoised."""
        if self.metropolis:
            return None
        if part:
            raise ValueError("LuxCore's sampling of a part is not that of the whole: it goes where the noise of all is")
        config = self.lux.Properties()
        config.Set(self.config)
        for key in FORCED:
            if not key.startswith("film.outputs."):
                config.Delete(key)
        config.Set(self.own)
        halt = {
            "batch.haltthreshold": threshold,
            "batch.haltthreshold.step": HALT_STEP,
            "batch.haltthreshold.warmup": HALT_STEP,
            "batch.haltspp": samples or MOST_SPP,
            "film.noiseestimation.step": HALT_STEP,
            "film.noiseestimation.warmup": HALT_STEP,
            "renderengine.seed": seed,
            "film.width": self.width,
            "film.height": self.height,
        }
        for key, value in halt.items():
            config.Set(self.lux.Property(key, [value]))
        session = self.lux.RenderSession(self.lux.RenderConfig(config, self.scene))
        session.Start()
        while not session.HasDone():
            time.sleep(POLL)
            # The halt condition is looked at here
            session.UpdateStats()
        film = session.GetFilm()
        picture = self._picture(film)
        session.Stop()
        return picture

    # Setting up

    def _configure(self, path, init, engine, sampler):
        """Reads configuration and scene; returns warnings."""
        config = self.lux.Properties()
        folder, name = os.path.split(path)
        scene_file = name
        if not name.endswith(".scn"):
            config.SetFromFile(path)
            if not config.IsDefined("scene.file"):
                raise ValueError(f"{name} does not say scene.file")
            scene_file = config.Get("scene.file").GetString()
        os.chdir(_root(folder, scene_file))
        self.description = self.lux.Properties(scene_file)

        warnings = []
        for key in CACHES:
            if config.IsDefined(key) and config.Get(key).GetBool():
                warnings.append(f"{key} is turned off: batches that share a photon cache are not independent")
            config.Set(self.lux.Property(key, [False]))
        # What `adaptive` renders with is the user's own
        self.own = self.lux.Properties()
        for prefix in OWN:
            self.own.Set(config.GetAllProperties(prefix))
        for prefix in REMOVED:
            config.DeleteAll(config.GetAllNames(prefix))
        self.width, self.height = (
            init.get(side) or (config.Get(f"film.{side}").GetInt() if config.IsDefined(f"film.{side}") else default)
            for side, default in [("width", 640), ("height", 480)]
        )

        set_all = dict(FORCED)
        set_all |= {"renderengine.type": ENGINES[engine], "sampler.type": SAMPLERS[sampler]}
        # A chain is a thread's: with one, a session is one chain, and tiles are spread over the processors
        set_all["native.threads.count"] = 1 if self.metropolis else init.get("threads") or os.cpu_count() or 1
        if init.get("max_depth") is not None:
            depth = init["max_depth"]
            if depth < 2:
                raise ValueError("LuxCore cannot render only directly seen light: max_depth must be at least 2")
            set_all |= {f"path.pathdepth.{kind}": depth for kind in ["total", "diffuse", "glossy", "specular"]}
            # Surfaces touched from either end
            set_all |= {"path.maxdepth": depth - 1, "light.maxdepth": depth - 1}
            if engine == "bidir":
                warnings.append("bidir limits the two ends of a path: with max_depth, longer paths get through")
        if engine == "bidir":
            # Its weights leave Russian roulette out, which makes the Cornell box 6 % too bright
            set_all["path.russianroulette.cap"] = 1.0
        for key, value in set_all.items():
            config.Set(self.lux.Property(key, [value]))
        self.config = config
        return warnings

    def _scene(self, window=None):
        """The scene, its camera looking through a window of the picture if one is given: left, right, bottom, top."""
        scene = self.lux.Scene()
        description = self.lux.Properties()
        description.Set(self.description)
        if window:
            description.Set(self.lux.Property("scene.camera.screenwindow", list(window)))
        scene.Parse(description)
        return scene

    def _session(self, scene, width, height, region=None):
        """A session, not yet started, with random numbers of its own."""
        self.drawn += 1
        digest = hashlib.blake2b(f"{self.seed} {self.drawn}".encode(), digest_size=4).digest()
        config = self.lux.Properties()
        config.Set(self.config)
        # LuxCore numbers threads on from this; 31 bits, because larger numbers do not survive its parser
        config.Set(self.lux.Property("renderengine.seed", [int.from_bytes(digest, "little") >> 1]))
        config.Set(self.lux.Property("film.width", [width]))
        config.Set(self.lux.Property("film.height", [height]))
        if region:
            config.Set(self.lux.Property("film.subregion", list(region)))
        return self.lux.RenderSession(self.lux.RenderConfig(config, scene))

    # Looking at sessions

    @staticmethod
    def _pause(total, goal, start):
        """Seconds to wait before the next look, so as not to be late."""
        left = (time.monotonic() - start) * (goal - total) / total if total > 0.0 else 0.0
        return min(max(left / 2, POLL / 100), POLL)

    @staticmethod
    def _total(film):
        """Samples, or mutations, that a film has taken in."""
        return film.GetStats().Get("stats.film.total.samplecount").GetFloat()

    def _picture(self, film):
        """Mean radiance, top row first."""
        rgb = self.np.empty((film.GetHeight(), film.GetWidth(), 3), self.np.float32)
        film.GetOutputFloat(self.lux.FilmOutputType.RGB, rgb)
        return rgb[::-1]

    def _counts(self, film):
        """Samples of each pixel, top row first."""
        counts = self.np.empty((film.GetHeight(), film.GetWidth()), self.np.uint32)
        film.GetOutputUInt(self.lux.FilmOutputType.SAMPLECOUNT, counts)
        return counts[::-1]

    # Random and Sobol samplers

    def _fresh_sessions(self, tiles):
        answers = [None] * len(tiles)
        for (x, y, width, height), (samples,), members in host.rectangles(tiles, ["samples"]):
            # LuxCore's regions include their ends, and count rows from the bottom
            bottom = self.height - y - height
            region = (x, x + width - 1, bottom, bottom + height - 1)
            keys = [tuple(tiles[member][side] for side in SIDES) for member in members]
            ahead = min(self.surplus.get(key, 0.0) for key in keys)
            session = self._session(self.scene, self.width, self.height, region)
            session.Start()
            film = session.GetFilm()
            pixels = width * height
            goal = max(1.0, samples - ahead) * pixels
            start, total = time.monotonic(), 0.0
            while total < goal:
                time.sleep(self._pause(total, goal, start))
                total = self._total(film)
            inside = (slice(y, y + height), slice(x, x + width))
            while total < goal + PATIENCE * pixels and self._counts(film)[inside].min() == 0:
                total = self._total(film)
            session.Stop()
            picture, counts = self._picture(film), self._counts(film)
            picture[counts == 0] = self.np.nan
            for member, key in zip(members, keys):
                x, y, width, height = key
                inside = (slice(y, y + height), slice(x, x + width))
                drawn = self.surplus.get(key, 0.0) + float(counts[inside].mean())
                given = said(samples, drawn)
                self.surplus[key] = drawn - given
                answers[member] = given, picture[inside]
        return answers

    def _in_blocks(self, tiles):
        """As many sessions of a block of points as the samples asked for take."""
        left = [tile["samples"] for tile in tiles]
        given, sums = [0] * len(tiles), [0.0] * len(tiles)
        while any(left):
            due = [i for i, samples in enumerate(left) if samples]
            parts = [tiles[i] | {"samples": min(SOBOL_BLOCK, left[i])} for i in due]
            for i, part, (samples, mean) in zip(due, parts, self._fresh_sessions(parts)):
                sums[i] = sums[i] + mean.astype(self.np.float64) * samples
                given[i] += samples
                left[i] -= part["samples"]
        return [(n, total / n) for n, total in zip(given, sums)]

    # Metropolis sampler

    def _continue_chains(self, tiles):
        answers = [None] * len(tiles)
        waiting = list(range(len(tiles)))
        pairs = [self._pair(tile) for tile in tiles]
        while waiting:
            # A tile may be named more than once: each chain continues for one request at a time
            running, later = {}, []
            for i in waiting:
                if any(chain in running for chain in pairs[i]):
                    later.append(i)
                    continue
                chain = min(pairs[i], key=lambda chain: chain.given)
                running[chain] = i
                # Nothing happens for some tenths of a second: paused threads look up rarely. Here they all do at once
                chain.session.Resume()
            while running:
                time.sleep(POLL / 5)
                for chain, i in list(running.items()):
                    if self._total(chain.film) >= (chain.given + tiles[i]["samples"]) * chain.pixels:
                        chain.session.Pause()
                        del running[chain]
                        answers[i] = self._new_mean(chain, tiles[i]["samples"])
            waiting = later
        return answers

    def _pair(self, tile):
        """The two chains of a tile, which start paused."""
        key = tuple(tile[side] for side in SIDES)
        if key not in self.chains:
            window = self._window(*key)
            self.chains[key] = [Chain(self._session(self._scene(window), *key[2:])) for _ in range(2)]
        return self.chains[key]

    def _window(self, x, y, width, height):
        """A tile's part of the camera's screen. A film of the tile's size takes little memory; one of the picture's, much."""
        camera = self.description.Get("scene.camera.type").GetString()
        if camera not in ("perspective", "orthographic"):
            raise ValueError(f"Metropolis needs a perspective or orthographic camera, not {camera}")
        if self.description.IsDefined("scene.camera.screenwindow"):
            left, right, bottom, top = self.description.Get("scene.camera.screenwindow").GetFloats()
        else:
            # LuxCore's own: 2 units along the longer side
            longer = max(self.width, self.height)
            right, top = self.width / longer, self.height / longer
            left, bottom = -right, -top
        across, up = (right - left) / self.width, (top - bottom) / self.height
        return (left + x * across, left + (x + width) * across, top - (y + height) * up, top - y * up)

    def _new_mean(self, chain, asked):
        """Mutations a pixel since the last batch, and their mean: what the chain's whole film has gained.

        The film is not emptied in between, because it divides by the weights in it. These vary, and the ratio of two sums
        over a batch would be further off than that over the whole chain."""
        new = said(asked, self._total(chain.film) / chain.pixels - chain.given)
        total = self._picture(chain.film).astype(self.np.float64) * (chain.given + new)
        mean = (total - chain.total) / new
        chain.given, chain.total = chain.given + new, total
        return new, mean


class Chain:
    """One paused session of a tile, and what has been handed out of it: mutations a pixel, and their sum."""

    def __init__(self, session):
        # Paused before it starts, it draws nothing yet
        session.Pause()
        session.Start()
        self.session, self.film = session, session.GetFilm()
        self.pixels = self.film.GetWidth() * self.film.GetHeight()
        self.given, self.total = 0, 0.0


def said(asked, drawn):
    """The number of samples a batch is said to have.

    A session stops when it notices that it has to, a little late. What it draws beyond the number asked for is taken off the
    tile's next batch: so numbers are as asked, and right in the long run. Only a session that stops much too late says so,
    lest a tile is ever ahead by more than about a batch."""
    return asked if drawn <= 2 * asked + 4 else int(drawn)


if __name__ == "__main__":
    host.serve(LuxCore)
