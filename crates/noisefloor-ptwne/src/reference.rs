//! Stub.
pub(crate) fn render(_: &crate::Scene, width: usize, height: usize) -> Vec<noisefloor::Rgb> {
    vec![[0.0; 3]; width * height]
}
