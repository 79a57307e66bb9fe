"""What is left in two pictures of one view, rendered alike with different seeds: of noise, or of what a denoiser makes of
it."""

import noisefloor
import numpy

from . import denoise, settings

ALBEDO, NORMAL = "Denoising Albedo", "Denoising Normal"
# Radiance of what a transparent film is shown on: middle grey, where view transforms show a change of light most
BACKDROP = numpy.float32(0.18)


class Judge:
    """scene: whose settings say who looks, and what may be wrong. shown: how pictures are displayed, see display.py. film:
    frames per second, or None for a still. denoised: whether pictures are, if this Blender can. catches: whether objects
    catch shadows, which lie in alpha, and are denoised there."""

    def __init__(self, scene, shown, film, denoised, catches):
        self.settings, self.film, self.catches = scene.noisefloor, film, catches
        self.library = denoise.library() if denoised else None
        # What denoises, and why it is not what the scene says
        device, self.note = denoise.device(scene, self.library) if self.library else (denoise.CPU, None)
        cycles = scene.cycles
        # Quality came with Blender 4.2
        how = {"prefilter": cycles.denoising_prefilter, "quality": getattr(cycles, "denoising_quality", "HIGH")}
        self.denoiser = denoise.Denoiser(self.library, device, **how) if self.library else None
        self.guides = {"RGB": [], "RGB_ALBEDO": [ALBEDO]}.get(cycles.denoising_input_passes, [ALBEDO, NORMAL])
        self.transparent = scene.render.film_transparent
        self.oracle = noisefloor.Oracle(self.settings.people)
        self.params = settings.params(scene, shown, film)
        self.view = scene.view_settings.view_transform

    def denoise(self, passes):
        """The denoised picture, with alpha, of passes by name."""
        made = passes["Combined"].copy(order="K")
        made[..., :3] = self._colours(passes)
        if self.catches and self.transparent:
            # Cycles does so with the light that a catcher lacks, of which alpha follows
            alpha = numpy.repeat(passes["Combined"][..., 3:], 3, axis=2)
            made[..., 3] = numpy.clip(self.denoise_alone(alpha)[..., 0], 0, 1)
        return made

    def _colours(self, passes):
        return self.denoiser.denoise(passes["Combined"][..., :3], *(passes.get(name) for name in self.guides))

    def denoise_alone(self, picture):
        """A picture of three channels, denoised by itself: its edges are not those of albedo and normals."""
        return self.denoiser.denoise(picture)

    def seen(self, picture):
        """A picture with alpha, as it is judged."""
        light = picture[..., :3]
        return light + (1 - picture[..., 3:]) * BACKDROP if self.transparent else light

    def excess(self, pair, counts=None):
        """How far the mean of two pictures, passes by name each, is from what may be seen; counts: as noisefloor.excess has
        them. Takes the time of the denoiser and of the vision model."""
        noisy = [self.seen(passes["Combined"]) for passes in pair]
        denoised = None
        if self.library:
            # Alpha is looked at only where something shows through
            made = self.denoise if self.transparent else self._colours
            denoised = tuple(self.seen(made(passes)) for passes in pair)
        try:
            return noisefloor.excess(
                *noisy,
                oracle=self.oracle,
                params=self.params,
                denoised=denoised,
                lost=self.settings.lost,
                counts=counts,
            )
        except noisefloor.PictureError as error:
            if "identical" not in str(error):
                raise
            raise ValueError("two pictures of different seeds are the same: there is no noise to see") from error

    def said(self):
        """For whom, in words."""
        film = f", {self.film:g} frames a second" if self.film else ""
        if self.library:
            what = f"denoised by Open Image Denoise, at most {self.settings.lost:.2g} JOD lost by the vision model"
        else:
            what = f"{self.settings.people:.0%} of people"
        return f"{what}, {self.settings.viewing}, {self.view}{film}"

