//! Executes the directives of a file.

use super::arguments::Arguments;
use super::params::Params;
use super::reader::{BOUNCES, MAX_DEPTH, Reader};
use super::state::{Definition, Look, Object};
use crate::colour::ColourSpace;
use crate::error::{LoadError, Place};
use glam::DMat4;
use std::rc::Rc;

/// Options that change noise, speed or what is printed, but not what samples are of.
const NO_OPTION_OF_PICTURES: [&str; 12] = [
    "disablepixeljitter",
    "disabletexturefiltering",
    "disablewavelengthjitter",
    "displacementedgescale",
    "gpu",
    "msereferenceimage",
    "msereferenceout",
    "nthreads",
    "pixelstats",
    "rendercoordsys",
    "seed",
    "wavefront",
];

/// What `Attribute` gives parameters to.
const TARGETS: [&str; 5] = ["shape", "light", "material", "medium", "texture"];

/// Directives of a kind in quotes and parameters.
const WITH_PARAMS: [&str; 17] = [
    "Accelerator",
    "AreaLightSource",
    "Attribute",
    "Camera",
    "ColorSpace",
    "Film",
    "Integrator",
    "LightSource",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "PixelFilter",
    "Renderer",
    "Sampler",
    "Shape",
    "SurfaceIntegrator",
    "VolumeIntegrator",
];

impl Reader<'_> {
    /// Executes a directive in a file that is included `depth` deep.
    pub(super) fn directive(
        &mut self,
        word: &str,
        args: &mut Arguments<'_, '_>,
        depth: u32,
    ) -> Result<(), LoadError> {
        if self.moves(word, args)? || self.nests(word, args)? {
            return Ok(());
        }
        match word {
            "WorldBegin" => {
                self.in_world = true;
                self.state.to_world = DMat4::IDENTITY;
                self.coordinate_systems.insert("world".to_owned(), DMat4::IDENTITY);
            }
            "WorldEnd" => {}
            // A parameter alone, in version 4 of a type and a name, and otherwise of a name
            "Option" => {
                let name = args.option()?;
                if !NO_OPTION_OF_PICTURES.contains(&name.as_str()) {
                    self.load.ignored(&args.place(), format!("the option `{name}` is ignored"));
                }
            }
            "ReverseOrientation" => self.state.reversed = !self.state.reversed,
            "ObjectInstance" => {
                let name = args.text()?;
                let result = self.instance(&name, &args.place());
                self.errors.take(result)?;
            }
            "Include" | "Import" => {
                let included = self.load.folder.find(&args.text()?, &args.place())?;
                self.file(&included, depth + 1)?;
            }
            "NamedMaterial" => self.state.material = Look::Named(args.text()?, args.place()),
            // One name or two
            "MediumInterface" => self.state.in_medium = args.texts()?.iter().any(|name| !name.is_empty()),
            "Texture" => {
                let (name, values, class) = (args.text()?, args.text()?, args.text()?);
                let params = args.params()?.in_space(self.state.colour_space);
                let params = self.with_defaults("texture", params)?;
                let result = self.texture(&name, &values, &class, &params);
                self.errors.take(result)?;
                self.say_unused(&params, &format!("{word} \"{class}\""));
            }
            _ if WITH_PARAMS.contains(&word) => {
                let kind = args.text()?;
                let params = args.params()?.in_space(self.state.colour_space);
                let result = self.with_params(word, &kind, params);
                self.errors.take(result)?;
            }
            // Of a fork of pbrt, or a slip: pbrt refuses it, too
            _ => {
                let unknown = args.place().bad(format!("the directive {word} is not known"));
                self.errors.take::<()>(Err(unknown))?;
                args.pass_all()?;
            }
        }
        Ok(())
    }

    /// Executes a directive that begins or ends a part of the file. The result is whether it was one.
    fn nests(&mut self, word: &str, args: &mut Arguments<'_, '_>) -> Result<bool, LoadError> {
        let place = args.place();
        let without_begin = || place.bad(format!("{word} without its begin"));
        match word {
            "AttributeBegin" => self.push(&place)?,
            "AttributeEnd" => self.state = self.stack.pop().ok_or_else(without_begin)?,
            "TransformBegin" => {
                place.at_most("nested transforms", self.transforms.len() as u64, u64::from(MAX_DEPTH))?;
                self.transforms.push(self.state.to_world);
            }
            "TransformEnd" => self.state.to_world = self.transforms.pop().ok_or_else(without_begin)?,
            "ObjectBegin" => {
                let name = args.text()?;
                if self.open_object.is_some() {
                    return Err(place.bad("an object in an object"));
                }
                self.push(&place)?;
                self.open_object = Some((name, vec![]));
            }
            "ObjectEnd" => {
                let (name, parts) = self.open_object.take().ok_or_else(without_begin)?;
                self.objects.insert(name, Object { parts, shared: None });
                self.state = self.stack.pop().ok_or_else(without_begin)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Executes a directive with a kind and parameters.
    fn with_params(&mut self, word: &str, kind: &str, params: Params) -> Result<(), LoadError> {
        let called = format!("{word} \"{kind}\"");
        if self.sets_up(word, kind, &params, &called)? {
            return Ok(());
        }
        match word {
            "Shape" => {
                let params = self.with_defaults("shape", params)?;
                self.shape(kind, &params)?;
                self.say_unused(&params, &called);
            }
            "Material" => {
                let params = self.with_defaults("material", params)?;
                self.state.material = Look::Given(self.definition(kind, params));
            }
            "MakeNamedMaterial" => {
                let params = self.with_defaults("material", params)?;
                let class = params.text("type")?.unwrap_or_default().to_owned();
                let definition = self.definition(&class, params);
                self.named_materials.insert(kind.to_owned(), definition);
            }
            "LightSource" => {
                let params = self.with_defaults("light", params)?;
                self.light_source(kind, &params)?;
                self.say_unused(&params, &called);
            }
            "AreaLightSource" => {
                if kind != "diffuse" && kind != "area" {
                    return Err(params.place.unsupported(called));
                }
                let params = self.with_defaults("light", params)?;
                self.state.area_light = self.area_light(&params)?.map(Rc::new);
            }
            "Attribute" => {
                if !TARGETS.contains(&kind) {
                    return Err(params.bad(format!("{called}: it is for {}", TARGETS.join(", "))));
                }
                let all = self.with_defaults(kind, params)?;
                self.state.defaults.insert(kind.to_owned(), Rc::new(all));
            }
            "MakeNamedMedium" => {
                if !self.options.ignore_volumes {
                    return Err(params.place.unsupported(crate::options::NO_MEDIA));
                }
                self.load.ignored(&params.place, "the participating medium is ignored");
            }
            // None other is asked for
            _ => {}
        }
        Ok(())
    }

    /// Executes a directive on how the picture is taken. The result is whether it was one.
    fn sets_up(&mut self, word: &str, kind: &str, params: &Params, called: &str) -> Result<bool, LoadError> {
        match word {
            "Camera" => {
                self.coordinate_systems.insert("camera".to_owned(), self.state.to_world.inverse());
                self.view.camera(kind, params, self.state.to_world)?;
                self.say_unused(params, called);
            }
            "Film" => {
                self.view.film(params)?;
                // Names and formats of files
                params.ignore(&["filename", "diagonal", "savefp16"]);
                if self.view.clamp.is_some() {
                    let what = "`maxcomponentvalue` bounds red, green and blue, \
                        where the sensor of pbrt bounds X, Y and Z";
                    self.load.approximated(&params.place, what);
                }
                self.say_unused(params, called);
            }
            "Integrator" => {
                // One more segment than bounces
                let bounces = params.count("maxdepth")?.unwrap_or(u64::from(BOUNCES));
                self.max_depth = u32::try_from(bounces).unwrap_or(u32::MAX).saturating_add(1);
                if !matches!(kind, "path" | "volpath" | "simplepath" | "simplevolpath" | "bdpt") {
                    let what = format!("the integrator `{kind}` is replaced by path tracing");
                    self.load.approximated(&params.place, what);
                }
                // How samples are taken
                params.ignore(&["lightsampler", "lightsamplestrategy", "strategy", "rrthreshold"]);
                self.say_unused(params, called);
            }
            "ColorSpace" => {
                let unknown = || params.place.unsupported(format!("the colour space `{kind}`"));
                self.state.colour_space = ColourSpace::named(kind).ok_or_else(unknown)?;
            }
            // Noise, speed, and the filter of the picture, which is the caller's
            "Sampler" | "PixelFilter" | "Accelerator" | "SurfaceIntegrator" | "Renderer"
            | "VolumeIntegrator" => {}
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Parameters with those that `Attribute` gave for all things of a kind.
    fn with_defaults(&self, kind: &str, params: Params) -> Result<Params, LoadError> {
        let Some(defaults) = self.state.defaults.get(kind) else { return Ok(params) };
        // Each is copied, and compared with each
        self.load.bounds.spend((16 + params.len()).saturating_mul(defaults.len()), &params.place)?;
        Ok(params.or(defaults))
    }

    fn definition(&self, kind: &str, params: Params) -> Rc<Definition> {
        // Only what it names: a copy of all for each material would be quadratic
        let state = &self.state;
        let (float_textures, colour_textures, heights) = (
            params.named_in(&state.float_textures),
            params.named_in(&state.colour_textures),
            params.named_in(&state.heights),
        );
        Rc::new(Definition { kind: kind.to_owned(), params, float_textures, colour_textures, heights })
    }

    fn push(&mut self, place: &Place) -> Result<(), LoadError> {
        place.at_most("nested attributes", self.stack.len() as u64, 1024)?;
        self.stack.push(self.state.clone());
        Ok(())
    }
}
