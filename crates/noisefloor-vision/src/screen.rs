//! Pixels per degree of a screen at a distance.

/// A flat screen of square pixels, seen from in front of its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Screen {
    /// Pixels in a row and rows of pixels.
    pub resolution: (u32, u32),
    /// Diagonal, in inches.
    pub diagonal: f64,
    /// Distance from the eye, in metres.
    pub distance: f64,
}

impl Screen {
    /// Pixels per degree of visual angle in the centre. Meaningless sizes give a number that
    /// `ViewingParams::check` rejects.
    pub fn pixels_per_degree(&self) -> f64 {
        let (columns, rows) = (f64::from(self.resolution.0), f64::from(self.resolution.1));
        let pixel = self.diagonal * 0.0254 / columns.hypot(rows);
        1.0 / (2.0 * (0.5 * pixel / self.distance).atan().to_degrees())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_screens() {
        // A pixel of 0.2767 mm at 60 cm: 1/37.85°
        let desk = Screen { resolution: (1920, 1080), diagonal: 24.0, distance: 0.6 };
        assert!((desk.pixels_per_degree() - 37.845_9).abs() < 1e-2, "{}", desk.pixels_per_degree());
        // A pixel as large as its distance spans 2·atan(½)
        let near = Screen { resolution: (3, 4), diagonal: 5.0 / 0.0254, distance: 1.0 };
        assert!((near.pixels_per_degree() - 1.0 / 53.130_102).abs() < 1e-9);
    }
}
