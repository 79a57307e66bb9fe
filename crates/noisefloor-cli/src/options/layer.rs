//! Which layer of a picture.

use clap::Args;

#[derive(Debug, Args)]
pub struct LayerArgs {
    /// Layer of EXR files that is read: its name, as in ViewLayer.Combined, or the end of it [default: the unnamed
    /// layer, or one named as renderers name the picture, such as Combined, rgba or beauty].
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
}
