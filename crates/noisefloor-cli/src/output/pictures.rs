//! image.exr, image.png, stops.png and noise.png.

use super::Output;
use super::tiles::{TileState, marks};
use noisefloor::{Rgb, Session, StoppingCriterion};
use noisefloor_image::maps::{Canvas, NOISE_SCALE, draw_field, draw_tiles};
use noisefloor_image::{RenderLayers, SampleFacts, write_exr};

impl Output {
    pub(super) fn write_pictures<C: StoppingCriterion>(
        &self,
        session: &Session<C>,
        tiles: &[TileState],
    ) -> anyhow::Result<()> {
        let film = session.film();
        let (width, height) = (film.grid().width(), film.grid().height());
        let image = film.image();

        // image.exr: what each pixel's tile knows, as channels
        let mut spp = vec![0u32; image.len()];
        let mut probability = vec![f32::NAN; image.len()];
        let mut stopped = vec![false; image.len()];
        for TileState { stop, open } in tiles {
            for pixel in stop.tile.rows(width).flatten() {
                spp[pixel] = u32::try_from(stop.spp).unwrap_or(u32::MAX);
                probability[pixel] = stop.probability.unwrap_or(f32::NAN);
                stopped[pixel] = !open;
            }
        }
        let noise = session.visible_noise();
        let counts = || tiles.iter().map(|tile| tile.stop.spp);
        let samples = counts().min().zip(counts().max()).filter(|(fewest, _)| *fewest > 0);
        let facts = SampleFacts { samples, origin: self.origin.clone() };
        let layers = RenderLayers {
            spp: Some(&spp),
            probability: Some(&probability),
            stopped: Some(&stopped),
            visible_noise: noise.as_deref(),
            facts: Some(&facts),
            ..RenderLayers::rgb(width, height, &image)
        };
        write_exr(self.path("image.exr"), &layers)?;

        // image.png, stops.png and noise.png: as the oracle saw it
        let display =
            session.display().copied().unwrap_or_else(|| session.params().tone_mapping.settle(&image));
        let encoded: Vec<Rgb> = image.iter().map(|&p| display.encode(p)).collect();
        Canvas::of_picture(width, &encoded).save(self.path("image.png"))?;
        let (marks, scale) = marks(tiles);
        draw_tiles(width, &encoded, &marks, &scale).save(self.path("stops.png"))?;
        if let Some(noise) = &noise {
            draw_field(width, &encoded, noise, &NOISE_SCALE).save(self.path("noise.png"))?;
        }
        Ok(())
    }
}
