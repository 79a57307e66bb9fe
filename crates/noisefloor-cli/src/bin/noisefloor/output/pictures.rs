//! image.exr, image.png, stops.png and noise.png.

use super::Output;
use super::tiles::{marks, states};
use noisefloor::Session;
use noisefloor_image::maps::{Canvas, NOISE_SCALE, draw_field, draw_tiles};
use noisefloor_image::{Plane, RenderLayers, SampleFacts, write_exr};

impl Output {
    pub fn write_pictures(&mut self, session: &Session) -> anyhow::Result<()> {
        self.forget_earlier()?;
        let tiles = states(session);
        let film = session.film();
        let grid = film.grid();
        let (width, height) = grid.size();

        // image.exr: what each pixel's tile knows, as channels. A picture can be large: nothing is copied.
        let tile = |pixel: usize| grid.index_at(pixel % width, pixel / width);
        let radiance = |pixel: usize| film.pixel(tile(pixel), pixel);
        let spp = |pixel: usize| u32::try_from(tiles[tile(pixel)].stop.spp).unwrap_or(u32::MAX);
        let probability = |pixel: usize| tiles[tile(pixel)].stop.probability.unwrap_or(f32::NAN);
        let stopped = |pixel: usize| !tiles[tile(pixel)].open;
        let noise = session.visible_noise();
        let counts = || tiles.iter().map(|tile| tile.stop.spp);
        let samples = counts().min().zip(counts().max()).filter(|(fewest, _)| *fewest > 0);
        let facts = SampleFacts { samples, origin: self.origin.clone() };
        let layers = RenderLayers {
            width,
            height,
            rgb: Plane::Computed(&radiance),
            spp: Some(Plane::Computed(&spp)),
            probability: Some(Plane::Computed(&probability)),
            stopped: Some(Plane::Computed(&stopped)),
            visible_noise: noise.as_deref().map(Plane::from),
            facts: Some(&facts),
        };
        write_exr(self.path("image.exr"), &layers)?;

        // image.png, stops.png and noise.png: as the oracle saw it
        let display = session.display_so_far();
        let shown = Canvas::of_pixels(width, height, |pixel| display.encode(radiance(pixel)));
        shown.save(self.path("image.png"))?;
        let (marks, scale) = marks(&tiles);
        draw_tiles(&shown, &marks, &scale).save(self.path("stops.png"))?;
        if let Some(noise) = &noise {
            draw_field(&shown, noise, &NOISE_SCALE).save(self.path("noise.png"))?;
        }
        Ok(())
    }
}
