"""What is left in two pictures of one view, rendered alike with different seeds: of noise, or of what a denoiser makes of
it."""

import noisefloor

from . import denoise, settings

ALBEDO, NORMAL = "Denoising Albedo", "Denoising Normal"


class Judge:
    """scene: whose settings say who looks, and what may be wrong. shown: how pictures are displayed, see display.py. film:
    frames per second, or None for a still."""

    def __init__(self, scene, shown, film=None):
        self.settings, self.film = scene.noisefloor, film
        self.library = denoise.library() if scene.cycles.use_denoising else None
        self.oracle = settings.oracle(self.settings)
        self.params = settings.params(scene, shown, film)
        self.view = scene.view_settings.view_transform

    def denoise(self, passes):
        """The denoised picture, of passes by name."""
        colour = passes["Combined"][..., :3]
        return denoise.denoise(self.library, colour, passes.get(ALBEDO), passes.get(NORMAL))

    def excess(self, pair):
        """How far the mean of two pictures, passes by name each, is from what may be seen; the time of the denoiser and
        of the vision model."""
        noisy = [passes["Combined"][..., :3] for passes in pair]
        denoised = tuple(self.denoise(passes) for passes in pair) if self.library else None
        try:
            return noisefloor.excess(
                *noisy, oracle=self.oracle, params=self.params, denoised=denoised, lost=self.settings.lost
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
