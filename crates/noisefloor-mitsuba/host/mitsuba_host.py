"""Mitsuba 3 as a source of samples for noisefloor. See host.py for the protocol."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import host

# Numbers of samples that one lane of a wavefront may take one after the other: fewer results to add up, and still lanes for many
# threads. The one that comes out even is chosen, since lanes run as long as the longest beside them.
RUNS = range(8, 17)
# Most lanes of one wavefront, 12 bytes of results each: what fills the threads of a processor, and those of a large GPU.
LANES, LANES_ON_GPU = 1 << 22, 1 << 25
# Where a GPU renders.
CUDA = "cuda_ad_rgb"
# Edge of the blocks of the scalar variant, which number its random streams. Fixed, so that they do not depend on threads.
BLOCK = 16
# Integrators that sample single rays: along paths, only at first hits, or by way of other integrators.
PATHS, FIRST_HITS, WRAPPERS = ("path", "volpath", "volpathmis"), ("direct", "depth"), ("aov", "moment", "stokes")
# Increment and multipliers of SplitMix64 (Steele, Lea and Flood 2014).
GOLDEN, MIX_1, MIX_2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
# Smooth boundaries in a row behind which first hits are looked for.
BOUNDARIES = 16
# Divides the seeds of first hits from those of paths.
APART = 0x6669727374686974
# Divides the second word of a stream's seed from the first.
SECOND = 0xD1B54A32D192ED03


class Mitsuba:
    """Loads the scene, and hands tiles to the variant that fits."""

    def __init__(self, init):
        warnings, wanted = [], init.get("device")
        gpu = host.pick(wanted, lambda: host.gpus_of(__file__), warnings)
        if gpu:
            # The only one that Dr.Jit will see, which takes the first
            visible = os.environ.get("CUDA_VISIBLE_DEVICES")
            os.environ["CUDA_VISIBLE_DEVICES"] = visible.split(",")[gpu[2]] if visible else str(gpu[2])
        import mitsuba as mi

        if gpu:
            it = [gpu], ""
            gpu = host.pick("auto" if wanted == "auto" else "gpu", lambda: it, warnings, lambda _: try_variant(mi, CUDA))
        variant = CUDA if gpu else choose_variant(mi, init["options"]["variant"], warnings)
        collector = collect_warnings(mi, warnings)
        if init["threads"] is not None:
            import drjit

            drjit.set_thread_count(init["threads"])
        parts = load(mi, init, warnings)
        collector.loading = False
        kind = Scalar if variant.startswith("scalar") else Wavefront
        self.renderer = kind(mi, *parts, init["seed"])
        self.mi, self.np, self.aov = mi, self.renderer.np, None
        film = self.renderer.film
        self.info = {
            "name": f"Mitsuba {mi.__version__} ({variant}{f', {gpu[1]}' if gpu else ''})",
            "width": film["width"],
            "height": film["height"],
            "unit": "samples-per-pixel",
            "repeats": self.renderer.repeats,
            "warnings": warnings,
        }

    def sample(self, tiles):
        return self.renderer.sample(tiles)

    def first_hits(self, index, samples):
        """Albedo and shading normals, from passes that are seeded apart."""
        mi, np, renderer = self.mi, self.np, self.renderer
        film, sensor = renderer.film, renderer.sensor
        crop = mi.traverse(sensor)
        crop["film.crop_size"] = [film["width"], film["height"]]
        crop["film.crop_offset"] = [film["x"], film["y"]]
        crop.update()
        if self.aov is None:
            self.aov = renderer.first_hits()
        most = max(1, LANES // (film["width"] * film["height"]))
        total, done = 0.0, 0
        while done < samples:
            number = min(most, samples - done)
            word = mix_integer(mix_integer(int(renderer.seed) ^ APART) + mix_integer(index << 32 | done))
            image = self.aov.render(renderer.scene, sensor=sensor, seed=word % (1 << 32), spp=number)
            total = total + np.array(image)[:, :, -6:].astype(np.float64) * number
            done += number
        mean = total / samples
        return np.clip(mean[:, :, :3], 0, 1), mean[:, :, 3:]

    @staticmethod
    def gpus():
        return host.cuda_gpus()


def try_variant(mi, variant):
    """Sets a variant; raises if it does not work here."""
    mi.set_variant(variant)
    if not variant.startswith("scalar"):
        # Compiler and driver are looked for when they are first needed.
        import drjit

        drjit.eval(mi.Float(1) + drjit.arange(mi.Float, 2))
    if variant == CUDA:
        # A driver that computes may lack what traces rays
        ball = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}})
        drjit.eval(ball.ray_test(mi.Ray3f(mi.Point3f(0, 0, drjit.arange(mi.Float, 2)), mi.Vector3f(0, 0, 1))))


def choose_variant(mi, wanted, warnings):
    """Sets the variant, or the scalar one where that does not work here."""
    try:
        try_variant(mi, wanted)
        return wanted
    except Exception as error:
        fallback = "scalar_rgb"
        if wanted == fallback:
            raise
        reason = str(error).strip().splitlines()[-1]
        warnings.append(f"{wanted} does not work here ({reason}); {fallback}, which is slower, has to do")
        mi.set_variant(fallback)
        return fallback


def collect_warnings(mi, warnings):
    """What Mitsuba warns of while it loads is the user's to know."""

    class Collector(mi.Appender):
        loading = True

        def append(self, level, text):
            print(text, file=sys.stderr)
            if self.loading and level >= mi.LogLevel.Warn:
                warnings.append(" ".join(text.split()))

        def log_progress(self, progress, name, formatted, eta, ptr=None):
            pass

    collector = Collector()
    mi.logger().clear_appenders()
    mi.logger().add_appender(collector)
    mi.set_log_level(mi.LogLevel.Warn)
    return collector


def load(mi, init, warnings):
    """The scene with a box filter, independent samples and the size and depth wanted; its sensor, integrator and film."""
    path = init["scene"]
    mi.file_resolver().append(os.path.dirname(path))
    config = mi.parser.ParserConfig(mi.variant())
    # Merged meshes come in an order that changes from process to process, and so do lights and what a seed gives
    config.merge_meshes = False
    state = mi.parser.parse_file(config, path)
    mi.parser.transform_all(config, state)
    nodes = state.nodes

    for node in nodes:
        if node.type == mi.ObjectType.Integrator:
            edit_integrator(mi, node.props, init, warnings)

    # One sensor, whose film and sampler are ours.
    sensors = [node.props for node in nodes if node.type == mi.ObjectType.Sensor]
    if not sensors:
        raise ValueError("the scene has no sensor; add one")
    if len(sensors) > 1:
        warnings.append(f"the scene has {len(sensors)} sensors; the first one is used")
    props, film = sensors[0], None
    for key in list(props.keys()):
        value = props[key]
        if isinstance(value, mi.Properties.ResolvedReference):
            child = nodes[value.index()]
            if child.type == mi.ObjectType.Film:
                film = read_film(child.props, init, warnings)
            if child.type in (mi.ObjectType.Film, mi.ObjectType.Sampler):
                del props[key]
    film = film or read_film(mi.Properties(), init, warnings)
    plugin = {"type": "hdrfilm", "pixel_format": "rgb", "filter": {"type": "box"}}
    plugin |= {"width": film["full_width"], "height": film["full_height"]}
    plugin |= {"crop_width": film["width"], "crop_height": film["height"]}
    plugin |= {"crop_offset_x": film["x"], "crop_offset_y": film["y"]}
    props["film"] = mi.load_dict(plugin)
    props["sampler"] = mi.load_dict({"type": "independent"})

    scene = mi.parser.instantiate(config, state)
    if isinstance(scene, list):
        scene = scene[0]
    integrator = scene.integrator()
    if integrator is None:
        depth = {} if init["max_depth"] is None else {"max_depth": init["max_depth"]}
        integrator = mi.load_dict({"type": "path", **depth})
    return scene, scene.sensors()[0], integrator, film


def edit_integrator(mi, props, init, warnings):
    """Sets the depth wanted. An integrator that cannot sample single rays makes way for a path tracer."""
    name = props.plugin_name()
    if name not in PATHS + FIRST_HITS + WRAPPERS:
        warnings.append(f"the integrator {name} is not driven from here; path, which is, takes its place")
        name = "path"
        props.set_plugin_name(name)
        for key in list(props.keys()):
            if key not in ("max_depth", "rr_depth", "hide_emitters"):
                del props[key]
    if init["max_depth"] is not None:
        if name in PATHS:
            props["max_depth"] = init["max_depth"]
        if name in FIRST_HITS:
            warnings.append(f"the integrator {name} has no depth that could be set")
    if mi.variant().startswith("scalar"):
        props["block_size"] = BLOCK


def read_film(props, init, warnings):
    """Sizes of a film: the whole, and the crop of it that is the image."""
    width, height = props.get("width", 768), props.get("height", 576)
    film = {"full_width": width, "full_height": height}
    film |= {"width": props.get("crop_width", width), "height": props.get("crop_height", height)}
    film |= {"x": props.get("crop_offset_x", 0), "y": props.get("crop_offset_y", 0)}
    if init["width"] is not None:
        # The same part of the scene in more or fewer pixels, as the built-in renderer shows it: the whole grows with it
        for size, offset in (("width", "x"), ("height", "y")):
            scale, wanted = init[size] / film[size], init[size]
            exact = film["full_" + size] * scale, film[offset] * scale
            film[offset] = round(exact[1])
            film["full_" + size] = max(round(exact[0]), film[offset] + wanted)
            film[size] = wanted
            if (film["full_" + size], film[offset]) != exact:
                warnings.append(f"the crop window has no whole pixels at this {size}: it is moved by up to one")
    return film


class Wavefront:
    """All pixels of all tiles in one wavefront, with Owen-scrambled Sobol points (Burley 2020, "Practical Hash-based Owen
    Scrambling"), two dimensions at a time. Scrambling and order follow from (seed, pixel, sequence, number of the draw): sequences
    of one pixel are independent, and so are pixels."""

    repeats = "samples"

    def __init__(self, mi, scene, sensor, integrator, film, seed):
        import drjit as dr
        import numpy as np

        self.mi, self.dr, self.np = mi, dr, np
        self.scene, self.sensor, self.integrator, self.film = scene, sensor, integrator, film
        self.seed = np.uint64(seed)

        class Points(mi.Sampler):
            """A sampler whose lanes are seeded one by one; Mitsuba's own number theirs."""

            def __init__(self):
                super().__init__(mi.Properties())
                self.key, self.index = mi.UInt64(0), mi.UInt32(0)

            def place(self, active):
                """The place of this draw in the sequence, shuffled, and a word to scramble it by."""
                key = mix(self.key + mi.UInt64(GOLDEN), mi.UInt64)
                self.key = dr.select(active, key, self.key)
                word = mix(key ^ mi.UInt64(SECOND), mi.UInt64)
                return shuffle(dr.brev(self.index), mi.UInt32(key)), mi.UInt32(word), mi.UInt32(word >> 32)

            def next_1d(self, active=True):
                place, first, _ = self.place(mi.Bool(active))
                return unit(shuffle(dr.brev(place), first))

            def next_2d(self, active=True):
                place, first, second = self.place(mi.Bool(active))
                place = dr.brev(place)
                return mi.Point2f(unit(shuffle(place, first)), unit(shuffle(pascal(place), second)))

        def shuffle(x, seed):
            """The hash of Laine and Karras (2011) with Burley's constants: each bit changes by those below it."""
            x = x + seed
            for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
                x = x ^ (x * mi.UInt32(factor))
            return x

        def pascal(x):
            """The generator matrix of Sobol's second dimension, Pascal's triangle modulo 2, is the fifth Kronecker power of one of
            2 by 2."""
            for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF)):
                x = x ^ ((x >> shift) & mi.UInt32(mask))
            return x

        def unit(x):
            """In [0, 1), of the reversed bits."""
            return mi.Float(dr.brev(x) >> 8) * (1 / (1 << 24))

        self.sampler = Points()

    def sample(self, tiles):
        # Lanes for each pixel of a tile, and samples of a lane. They depend on nothing but the number of samples, so that sums are
        # the same in any company
        runs = [min(RUNS, key=lambda run: -tile["samples"] % run) for tile in tiles]
        lanes = [-(-tile["samples"] // run) for tile, run in zip(tiles, runs)]
        most = LANES_ON_GPU if self.mi.variant() == CUDA else LANES
        means = [self.np.empty((tile["width"] * tile["height"], 3), self.np.float32) for tile in tiles]
        # Pieces of tiles that fit a wavefront, as many as fit it together
        together, taken = [], 0
        for number, mean in enumerate(means):
            rows = max(most // lanes[number], 1)
            for start in range(0, len(mean), rows):
                count = min(rows, len(mean) - start)
                if taken + count * lanes[number] > most and together:
                    self.wavefront(tiles, runs, lanes, together, means)
                    together, taken = [], 0
                together.append((number, start, count))
                taken += count * lanes[number]
        self.wavefront(tiles, runs, lanes, together, means)
        return [(tile["samples"], mean) for tile, mean in zip(tiles, means)]

    def wavefront(self, tiles, runs, lanes, pieces, means):
        """Renders pieces, each a tile's number, its first pixel and how many there are, and puts them into the means of tiles."""
        mi, dr, np = self.mi, self.dr, self.np
        numbers, starts, counts = (np.array(column) for column in zip(*pieces))
        lanes_of = np.array([lanes[number] for number in numbers])

        def begins(sizes):
            return np.cumsum(sizes) - sizes

        # One array, whose numbers of a piece lie side by side: of many arrays, Dr.Jit makes a new kernel for each order that they
        # come in, and keeps them all
        columns = {name: [tiles[number][name] for number in numbers] for name in ("x", "y", "width", "samples", "point", "sequence")}
        columns |= {"run": [runs[number] for number in numbers], "lanes": lanes_of, "start": starts}
        columns |= {"first_lane": begins(counts * lanes_of), "first_pixel": begins(counts)}
        names = list(columns)
        table = mi.UInt64(np.stack([np.asarray(columns[name], np.uint64) for name in names], axis=1).ravel())

        def of(name, piece, kind=mi.UInt32):
            return kind(dr.gather(mi.UInt64, table, piece * len(names) + names.index(name)))

        def pieces_of(sizes):
            return mi.UInt32(np.repeat(np.arange(len(pieces), dtype=np.uint32), sizes))

        # Only the piece is known of a lane here; whatever follows from it is worked out where the samples are taken. The
        # processor's last vector may reach past the last lane, where a gather gives 0, and dividing by that is a fault
        piece = pieces_of(counts * lanes_of)
        lane = dr.arange(mi.UInt32, dr.width(piece)) - of("first_lane", piece)
        each, width, run = dr.maximum(of("lanes", piece), 1), dr.maximum(of("width", piece), 1), of("run", piece)
        place = lane // each
        begin = (lane - place * each) * run
        number = dr.minimum(of("samples", piece) - begin, run)
        place += of("start", piece)
        row = place // width
        x, y = of("x", piece) + place - row * width, of("y", piece) + row
        pixel = mix(mi.UInt64(y) << 32 | mi.UInt64(x), mi.UInt64)
        key = mix(pixel ^ dr.opaque(mi.UInt64, self.seed), mi.UInt64) + of("sequence", piece, mi.UInt64) * mi.UInt64(GOLDEN)
        key, index = mix(key, mi.UInt64), of("point", piece, mi.UInt64) + mi.UInt64(begin)

        def one_more(done, sum):
            self.seed_points(key, index + mi.UInt64(done))
            return done + 1, sum + self.radiance(x, y)

        start = (mi.UInt32(0), mi.Color3f(0))
        _, sum = dr.while_loop(start, lambda done, sum: done < number, one_more)
        # What was drawn in the loop has no meaning outside of it.
        self.seed_points(mi.UInt64(0), mi.UInt64(0))
        dr.eval(sum)

        # Lanes of a pixel one after the other, whatever runs them
        piece = pieces_of(counts)
        each, samples = of("lanes", piece), mi.Float64(of("samples", piece))
        first = of("first_lane", piece) + (dr.arange(mi.UInt32, dr.width(piece)) - of("first_pixel", piece)) * each

        def add_lane(place, *totals):
            added = (total + mi.Float64(dr.gather(mi.Float, one, first + place)) for total, one in zip(totals, sum))
            return place + 1, *added

        start = (mi.UInt32(0), mi.Float64(0), mi.Float64(0), mi.Float64(0))
        _, *totals = dr.while_loop(start, lambda place, *totals: place < each, add_lane)
        mean = dr.ravel(mi.Color3f([mi.Float(total / samples) for total in totals])).numpy().reshape(-1, 3)
        for number, first, count, begin in zip(numbers, starts, counts, begins(counts)):
            means[number][first : first + count] = mean[begin : begin + count]

    def first_hits(self):
        """An integrator whose last six channels are the albedo and the shading normal of the first surface that scatters, also
        behind smooth glass and in mirrors: each ray takes one way of a boundary, by what the ways carry. What is no surface has
        the colour of the surroundings, cut to 1, and no normal."""
        mi, dr = self.mi, self.dr
        context, flags = mi.BSDFContext(), mi.BSDFFlags

        class FirstHits(mi.SamplingIntegrator):
            def aov_names(self):
                return [f"{name}.{axis}" for name in ("albedo", "normal") for axis in "XYZ"]

            def sample(self, scene, sampler, ray, medium=None, active=True):
                sky = scene.environment()

                def step(sampler, ray, boundaries, weight, albedo, normal, active):
                    si = scene.ray_intersect(ray, active)
                    hit = active & si.is_valid()
                    if sky is not None:
                        albedo += dr.select(active & ~hit, weight * dr.clip(sky.eval(si, active & ~hit), 0, 1), 0)
                    bsdf = si.bsdf(ray)
                    chosen, carried = bsdf.sample(context, si, sampler.next_1d(hit), sampler.next_2d(hit), hit)
                    # A mask lets rays pass by its opacity; coats of what scatters are left out
                    passed = mi.has_flag(chosen.sampled_type, flags.Null)
                    passed |= mi.has_flag(chosen.sampled_type, flags.Delta) & ~mi.has_flag(bsdf.flags(), flags.Smooth)
                    passed &= hit & (boundaries < BOUNDARIES)
                    ends = hit & ~passed
                    # Of what is not diffuse, what it reflects
                    colour = dr.select(mi.has_flag(bsdf.flags(), flags.Diffuse), bsdf.eval_diffuse_reflectance(si, ends), carried)
                    albedo += dr.select(ends, weight * dr.clip(colour, 0, 1), 0)
                    facing = dr.mulsign(mi.Vector3f(si.sh_frame.n), -dr.dot(ray.d, si.sh_frame.n))
                    normal += dr.select(ends, facing, 0)
                    # Radiance is scaled by the square of the index of refraction where it changes; albedo is not
                    weight *= dr.select(passed, carried * dr.square(chosen.eta), 1)
                    ray = si.spawn_ray(si.to_world(chosen.wo))
                    return sampler, ray, boundaries + 1, weight, albedo, normal, passed

                start = (sampler, mi.Ray3f(ray), mi.UInt32(0), mi.Color3f(1), mi.Color3f(0), mi.Vector3f(0), mi.Bool(active))
                *_, albedo, normal, _ = dr.while_loop(start, lambda *state: state[-1], step)
                return albedo, mi.Bool(active), [*dr.clip(albedo, 0, 1), *normal]

        return FirstHits(mi.Properties())

    def seed_points(self, key, index):
        """Point `index` of the sequence with that key."""
        self.sampler.key, self.sampler.index = key, self.mi.UInt32(index)

    def radiance(self, x, y):
        """What comes through a uniform place in each pixel: that is the box filter."""
        mi, draw, sensor = self.mi, self.sampler, self.sensor
        offset = draw.next_2d()
        place = mi.Point2f((x + offset.x) / self.film["width"], (y + offset.y) / self.film["height"])
        lens = draw.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5)
        time = mi.Float(sensor.shutter_open())
        if sensor.shutter_open_time() > 0:
            time += draw.next_1d() * sensor.shutter_open_time()
        ray, weight = sensor.sample_ray_differential(time, 0.5, place, lens)
        return weight * self.integrator.sample(self.scene, draw, ray, sensor.get_medium())[0]


def mix(x, word):
    """The finaliser of SplitMix64, of 64-bit words of numpy or Dr.Jit."""
    x = (x ^ (x >> word(30))) * word(MIX_1)
    x = (x ^ (x >> word(27))) * word(MIX_2)
    return x ^ (x >> word(31))


class Scalar:
    """Tiles one after the other, as crop windows.

    Mitsuba numbers the streams of a crop window seed x area + (0, 1, ...), in 32 bits, a stream a pixel, in blocks. Equal or
    neighbouring seeds for windows of different area therefore share streams. Here every window gets numbers that no window had
    before, by a seed that is worked out from them."""

    repeats = "calls"

    def __init__(self, mi, scene, sensor, integrator, film, seed):
        import numpy as np

        self.mi, self.np = mi, np
        self.scene, self.sensor, self.integrator, self.film = scene, sensor, integrator, film
        self.crop = mi.traverse(sensor)
        self.seed = seed
        self.next_stream = None

    def first_hits(self):
        """Mitsuba's own integrator for them. It stops at glass and mirrors, whose albedo is black, as that of some other materials."""
        return self.mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})

    def sample(self, tiles):
        if self.next_stream is None:
            # Where the numbers start follows from the first request: a process that takes the place of another one must not
            # begin with the streams that the other began with.
            word = self.seed
            for tile in tiles:
                for value in (tile["index"], tile["first"]):
                    word = mix_integer(word ^ mix_integer(value + GOLDEN))
            self.next_stream = word % (1 << 32)
        return [(tile["samples"], self.mean(tile)) for tile in tiles]

    def mean(self, tile):
        self.crop["film.crop_size"] = [tile["width"], tile["height"]]
        self.crop["film.crop_offset"] = [self.film["x"] + tile["x"], self.film["y"] + tile["y"]]
        self.crop.update()
        seed = self.seed_for(tile["width"], tile["height"])
        image = self.integrator.render(self.scene, sensor=self.sensor, seed=seed, spp=tile["samples"])
        # Colour comes first, before whatever else an integrator puts out.
        return self.np.array(image)[:, :, :3]

    def seed_for(self, width, height):
        """The seed that makes a window of this size begin at the next stream that is free."""
        area = width * height
        # seed x area reaches multiples of the power of two in the area alone, by the inverse of its odd part.
        power = area & -area
        blocks = -(-width // BLOCK) * -(-height // BLOCK)
        begin = -(-self.next_stream // power) * power
        self.next_stream = begin + blocks * BLOCK * BLOCK
        modulus = (1 << 32) // power
        return begin // power * pow(area // power, -1, modulus) % modulus if modulus > 1 else 0


def mix_integer(x):
    """`mix` of a Python integer."""
    mask = (1 << 64) - 1
    x = ((x & mask) ^ (x & mask) >> 30) * MIX_1 & mask
    x = (x ^ x >> 27) * MIX_2 & mask
    return x ^ x >> 31


host.serve(Mitsuba)
