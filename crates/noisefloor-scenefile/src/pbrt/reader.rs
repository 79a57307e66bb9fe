//! Executes the directives of a file.

use super::camera::View;
use super::params::{self, Params, at, number};
use super::state::{Definition, Look, Part, State};
use super::tokens::{Kind, Tokens};
use crate::Loaded;
use crate::error::{Errors, LoadError, Place, Warning};
use crate::files::{self, Folder, MAX_FILE_BYTES};
use crate::options::LoadOptions;
use flate2::read::GzDecoder;
use glam::{DMat4, DVec3};
use noisefloor_ptwne::{MaterialId, SceneBuilder, SceneError};
use std::collections::{HashMap, HashSet};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// How deep files may include each other, attributes nest and materials refer to others.
const MAX_DEPTH: u32 = 64;
/// Most bytes of all files of directives.
const MAX_BYTES: u64 = 1 << 29;
/// Most warnings that are kept.
const MAX_WARNINGS: usize = 10_000;
/// Most pixels of all pictures together.
const MAX_PIXELS: u64 = 1 << 27;

/// A scene that is being read.
pub(super) struct Reader<'a> {
    pub(super) path: PathBuf,
    pub(super) options: &'a LoadOptions,
    pub(super) folder: Folder,
    pub(super) state: State,
    pub(super) view: View,
    /// Collected parts of the scene. Its camera is set at the end.
    pub(super) builder: SceneBuilder,
    pub(super) named_materials: HashMap<String, Rc<Definition>>,
    pub(super) materials: HashMap<(String, Option<String>), MaterialId>,
    /// Definitions whose addresses are keys of `materials`.
    pub(super) kept: Vec<Rc<Definition>>,
    pub(super) objects: HashMap<String, Vec<Part>>,
    /// The object that is being defined.
    pub(super) open_object: Option<(String, Vec<Part>)>,
    pub(super) surrounded: bool,
    pub(super) max_depth: Option<u32>,
    pub(super) pixels: u64,
    stack: Vec<State>,
    transforms: Vec<DMat4>,
    coordinate_systems: HashMap<String, DMat4>,
    in_world: bool,
    bytes: u64,
    errors: Errors,
    warnings: Vec<Warning>,
    said: HashSet<(Option<String>, String)>,
}

impl<'a> Reader<'a> {
    pub(super) fn new(path: &Path, options: &'a LoadOptions) -> Result<Self, LoadError> {
        let place = Place::file(path);
        let refused = |cause| LoadError::Scene { place: place.clone(), cause };
        Ok(Self {
            path: path.to_owned(),
            options,
            folder: Folder::of(path, options.root.as_deref()),
            state: State::new(place.clone()),
            view: View::default(),
            builder: SceneBuilder::new(crate::title(path), View::anywhere()).map_err(refused)?,
            named_materials: HashMap::new(),
            materials: HashMap::new(),
            kept: vec![],
            objects: HashMap::new(),
            open_object: None,
            surrounded: false,
            max_depth: None,
            pixels: 0,
            stack: vec![],
            transforms: vec![],
            coordinate_systems: HashMap::new(),
            in_world: false,
            bytes: 0,
            errors: Errors::default(),
            warnings: vec![],
            said: HashSet::new(),
        })
    }

    /// Executes the file in `path`, which may be gzipped.
    pub(super) fn file(&mut self, path: &Path, depth: u32) -> Result<(), LoadError> {
        let place = Place::file(path);
        place.clone().at_most("levels of included files", u64::from(depth), u64::from(MAX_DEPTH))?;
        let bytes = self.bytes_of(path, MAX_BYTES - self.bytes, &place)?;
        self.bytes += bytes.len() as u64;
        let text =
            std::str::from_utf8(&bytes).map_err(|e| place.bad(format!("the file is not UTF-8: {e}")))?;
        let mut tokens = Tokens::new(text);
        loop {
            let open = |line: u32| at(path, line).bad("a quote does not end");
            let Some(token) = tokens.next().map_err(open)? else { return Ok(()) };
            let Kind::Word(word) = token.kind else {
                return Err(at(path, token.line).bad("expected a directive such as Shape"));
            };
            self.directive(&word, &mut tokens, path, token.line, depth)?;
        }
    }

    /// The bytes of a file, inflated if it is gzipped.
    pub(super) fn bytes_of(&self, path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
        let bytes = files::read(path, limit.min(MAX_FILE_BYTES), place)?;
        if !bytes.starts_with(&[0x1f, 0x8b]) {
            return Ok(bytes);
        }
        let mut inflated = Vec::new();
        let read = GzDecoder::new(bytes.as_slice()).take(limit + 1).read_to_end(&mut inflated);
        read.map_err(|e| Place::file(path).bad(format!("the file cannot be inflated: {e}")))?;
        Place::file(path).at_most("bytes, inflated", inflated.len() as u64, limit)?;
        Ok(inflated)
    }

    fn directive(
        &mut self,
        word: &str,
        tokens: &mut Tokens<'_>,
        path: &Path,
        line: u32,
        depth: u32,
    ) -> Result<(), LoadError> {
        let place = at(path, line);
        if self.moves(word, tokens, path, line)? {
            return Ok(());
        }
        match word {
            "AttributeBegin" => self.push(&place)?,
            "AttributeEnd" => {
                self.state = self.stack.pop().ok_or_else(|| place.bad("AttributeEnd without its begin"))?;
            }
            "TransformBegin" => {
                place.at_most("nested transforms", self.transforms.len() as u64, u64::from(MAX_DEPTH))?;
                self.transforms.push(self.state.to_world);
            }
            "TransformEnd" => {
                let last = self.transforms.pop();
                self.state.to_world = last.ok_or_else(|| place.bad("TransformEnd without its begin"))?;
            }
            "WorldBegin" => {
                self.in_world = true;
                self.state.to_world = DMat4::IDENTITY;
                self.coordinate_systems.insert("world".to_owned(), DMat4::IDENTITY);
            }
            "WorldEnd" => {}
            // Parameters alone
            "Option" => drop(params::read(tokens, path, line)?),
            "ReverseOrientation" => self.state.reversed = !self.state.reversed,
            "ObjectBegin" => {
                let name = self.text(tokens, path, line)?;
                if self.open_object.is_some() {
                    return Err(place.bad("an object in an object"));
                }
                self.push(&place)?;
                self.open_object = Some((name, vec![]));
            }
            "ObjectEnd" => {
                let (name, parts) = self
                    .open_object
                    .take()
                    .ok_or_else(|| place.clone().bad("ObjectEnd without its begin"))?;
                self.objects.insert(name, parts);
                self.state = self.stack.pop().ok_or_else(|| place.bad("ObjectEnd without its begin"))?;
            }
            "ObjectInstance" => {
                let name = self.text(tokens, path, line)?;
                let result = self.instance(&name, &place);
                self.errors.take(result)?;
            }
            "Include" | "Import" => {
                let name = self.text(tokens, path, line)?;
                let included = self.folder.find(&name, &place)?;
                self.file(&included, depth + 1)?;
            }
            "NamedMaterial" => {
                let name = self.text(tokens, path, line)?;
                self.state.material = Look::Named(name, place);
            }
            "MediumInterface" => {
                // One name or two
                let mut names = vec![self.text(tokens, path, line)?];
                let open = |line: u32| at(path, line).bad("a quote does not end");
                while let Some(Kind::Text(_)) = tokens.peek().map_err(open)?.map(|token| &token.kind) {
                    names.push(self.text(tokens, path, line)?);
                }
                self.state.in_medium = names.iter().any(|name| !name.is_empty());
            }
            _ => {
                let kind = self.text(tokens, path, line)?;
                if word == "Texture" {
                    let values = self.text(tokens, path, line)?;
                    let class = self.text(tokens, path, line)?;
                    let params = params::read(tokens, path, line)?;
                    let result = self.texture(&kind, &values, &class, &params);
                    self.errors.take(result)?;
                    self.say_unused(&params, &format!("{word} \"{class}\""));
                    return Ok(());
                }
                let params = params::read(tokens, path, line)?;
                let result = self.with_params(word, &kind, params);
                self.errors.take(result)?;
            }
        }
        Ok(())
    }

    /// Directives of a kind and parameters.
    fn with_params(&mut self, word: &str, kind: &str, params: Params) -> Result<(), LoadError> {
        let called = format!("{word} \"{kind}\"");
        match word {
            "Shape" => {
                let defaults = self.defaults("shape", &params);
                let params = params.or(&defaults);
                self.shape(kind, &params)?;
                self.say_unused(&params, &called);
            }
            "Material" => self.state.material = Look::Given(self.definition(kind, params)),
            "MakeNamedMaterial" => {
                let class = params.text("type")?.unwrap_or_default().to_owned();
                let definition = self.definition(&class, params);
                self.named_materials.insert(kind.to_owned(), definition);
            }
            "LightSource" => {
                let defaults = self.defaults("light", &params);
                let params = params.or(&defaults);
                self.light_source(kind, &params)?;
                self.say_unused(&params, &called);
            }
            "AreaLightSource" => {
                if kind != "diffuse" && kind != "area" {
                    return Err(params.place.clone().unsupported(called));
                }
                self.state.area_light = Some(Rc::new(params));
            }
            "Camera" => {
                self.coordinate_systems.insert("camera".to_owned(), self.state.to_world.inverse());
                self.view.camera(kind, &params, self.state.to_world)?;
                self.say_unused(&params, &called);
            }
            "Film" => {
                self.view.film(&params)?;
                params.ignore(&[
                    "filename",
                    "diagonal",
                    "savefp16",
                    "maxcomponentvalue",
                    "cropwindow",
                    "pixelbounds",
                ]);
                self.say_unused(&params, &called);
            }
            "Integrator" => {
                self.max_depth =
                    params.count("maxdepth")?.map(|d| u32::try_from(d).unwrap_or(u32::MAX - 1) + 1);
                if !matches!(kind, "path" | "volpath" | "simplepath" | "simplevolpath" | "bdpt") {
                    self.approximated(
                        &params.place,
                        format!("the integrator `{kind}` is replaced by path tracing"),
                    );
                }
            }
            "Attribute" => {
                let all = params.or(&self.defaults(kind, &Params::none(Place::file(&self.path))));
                self.state.defaults.insert(kind.to_owned(), Rc::new(all));
            }
            "MakeNamedMedium" => {
                if !self.options.ignore_volumes {
                    return Err(params.place.clone().unsupported("a participating medium"));
                }
                self.ignored(&params.place, "the participating medium is ignored");
            }
            "Sampler" | "PixelFilter" | "Accelerator" | "ColorSpace" | "SurfaceIntegrator" | "Renderer"
            | "VolumeIntegrator" => {}
            _ => self.ignored(&params.place, format!("the directive {word} is ignored")),
        }
        Ok(())
    }

    /// The parameters that `Attribute` gave for things of a kind, but for colour spaces.
    fn defaults(&self, kind: &str, params: &Params) -> Params {
        match self.state.defaults.get(kind) {
            Some(defaults) => (**defaults).clone(),
            None => Params::none(params.place.clone()),
        }
    }

    fn definition(&self, kind: &str, params: Params) -> Rc<Definition> {
        Rc::new(Definition {
            kind: kind.to_owned(),
            params,
            float_textures: self.state.float_textures.clone(),
            colour_textures: self.state.colour_textures.clone(),
        })
    }

    /// Directives that move what comes next. The result is whether it was one.
    fn moves(
        &mut self,
        word: &str,
        tokens: &mut Tokens<'_>,
        path: &Path,
        line: u32,
    ) -> Result<bool, LoadError> {
        let place = at(path, line);
        let step = match word {
            "Identity" => {
                self.state.to_world = DMat4::IDENTITY;
                return Ok(true);
            }
            "Translate" => DMat4::from_translation(numbers::<3>(tokens, path, line)?.into()),
            "Scale" => DMat4::from_scale(numbers::<3>(tokens, path, line)?.into()),
            "Rotate" => {
                let [angle, x, y, z] = numbers(tokens, path, line)?;
                let axis = DVec3::new(x, y, z).try_normalize();
                let axis = axis.ok_or_else(|| place.clone().bad("a rotation needs an axis that is not 0"))?;
                DMat4::from_axis_angle(axis, angle.to_radians())
            }
            "LookAt" => look_at(numbers(tokens, path, line)?, &place)?,
            "Transform" => {
                self.state.to_world = DMat4::from_cols_array(&numbers(tokens, path, line)?);
                return Ok(true);
            }
            "ConcatTransform" => DMat4::from_cols_array(&numbers(tokens, path, line)?),
            "CoordinateSystem" => {
                let name = self.text(tokens, path, line)?;
                self.coordinate_systems.insert(name, self.state.to_world);
                return Ok(true);
            }
            "CoordSysTransform" => {
                let name = self.text(tokens, path, line)?;
                let found = self.coordinate_systems.get(&name).copied();
                self.state.to_world =
                    found.ok_or_else(|| place.bad(format!("there is no coordinate system `{name}`")))?;
                return Ok(true);
            }
            "TransformTimes" => {
                numbers::<2>(tokens, path, line)?;
                return Ok(true);
            }
            "ActiveTransform" => {
                tokens.next().map_err(|line| at(path, line).bad("a quote does not end"))?;
                self.approximated(&place, "everything stays where it is when the shutter opens");
                return Ok(true);
            }
            _ => return Ok(false),
        };
        self.state.to_world *= step;
        if self.state.to_world.is_finite() { Ok(true) } else { Err(place.bad("the transform is too large")) }
    }

    fn text(&self, tokens: &mut Tokens<'_>, path: &Path, line: u32) -> Result<String, LoadError> {
        match tokens.next().map_err(|line| at(path, line).bad("a quote does not end"))?.map(|t| t.kind) {
            Some(Kind::Text(text)) => Ok(text),
            _ => Err(at(path, line).bad("expected a directive with a name in quotes")),
        }
    }

    fn push(&mut self, place: &Place) -> Result<(), LoadError> {
        place.clone().at_most("nested attributes", self.stack.len() as u64, 1024)?;
        self.stack.push(self.state.clone());
        Ok(())
    }

    /// The error that the renderer does not take something.
    pub(super) fn refused(place: &Place) -> impl Fn(SceneError) -> LoadError + use<> {
        let place = place.clone();
        move |cause| LoadError::Scene { place: place.clone(), cause }
    }

    pub(super) fn ignored(&mut self, place: &Place, what: impl std::fmt::Display) {
        self.warn(Warning::ignored(place.clone(), what));
    }

    pub(super) fn approximated(&mut self, place: &Place, what: impl std::fmt::Display) {
        self.warn(Warning::approximated(place.clone(), what));
    }

    fn warn(&mut self, warning: Warning) {
        let key = (warning.place.part.clone(), warning.what.clone());
        if self.warnings.len() < MAX_WARNINGS && self.said.insert(key) {
            self.warnings.push(warning);
        }
    }

    /// Warns of parameters that nobody asked for.
    pub(super) fn say_unused(&mut self, params: &Params, called: &str) {
        let unused: Vec<String> = params.unused().map(|p| p.name.clone()).collect();
        for name in unused {
            self.ignored(&params.place, format!("`{name}` of {called} is ignored"));
        }
    }

    /// Counts pixels that are kept, and refuses more than [`MAX_PIXELS`].
    pub(super) fn count_pixels(&mut self, place: &Place, count: usize) -> Result<(), LoadError> {
        self.pixels = self.pixels.saturating_add(count as u64);
        place.clone().at_most("pixels in all pictures so far", self.pixels, MAX_PIXELS)
    }

    /// The scene, after the last directive.
    pub(super) fn finish(self) -> Result<Loaded, LoadError> {
        let Self { view, mut builder, errors, warnings, path, max_depth, in_world, .. } = self;
        errors.finish()?;
        let whole = Place::file(&path);
        if !in_world {
            return Err(whole.bad("the scene has no WorldBegin: it is a part of another file"));
        }
        let refused = Self::refused(&whole);
        builder.optics(view.optics()).map_err(&refused)?;
        let scene = builder.build().map_err(&refused)?;
        let scene = scene.with_camera(view.look()).map_err(&refused)?;
        // One more segment than bounces
        Ok(Loaded { scene, size: Some(view.size()), max_depth, warnings })
    }
}

/// As many numbers, bare or in brackets.
fn numbers<const N: usize>(tokens: &mut Tokens<'_>, path: &Path, line: u32) -> Result<[f64; N], LoadError> {
    let mut found = [0.0; N];
    let mut count = 0;
    let mut bracket = false;
    loop {
        if count == N && !bracket {
            return Ok(found);
        }
        let token = tokens.next().map_err(|line| at(path, line).bad("a quote does not end"))?;
        let here = at(path, token.as_ref().map_or(line, |token| token.line));
        match token.map(|token| token.kind) {
            Some(Kind::Open) if count == 0 && !bracket => bracket = true,
            Some(Kind::Close) if bracket && count == N => return Ok(found),
            Some(Kind::Word(word)) if count < N => {
                found[count] = number(&word, &here)?;
                count += 1;
            }
            _ => return Err(here.bad(format!("expected {N} numbers"))),
        }
    }
}

/// From the world to a camera at `eye` that looks along +z, with +y up and +x to the right.
fn look_at(numbers: [f64; 9], place: &Place) -> Result<DMat4, LoadError> {
    let [eye, target, up] = [0, 3, 6].map(|i| DVec3::new(numbers[i], numbers[i + 1], numbers[i + 2]));
    let view = (target - eye).try_normalize();
    let axes = view.and_then(|view| {
        let right = up.normalize_or_zero().cross(view).try_normalize()?;
        Some([right, view.cross(right), view])
    });
    let what = "eye and target are the same, or `up` points along the view";
    let [x, y, z] = axes.ok_or_else(|| place.clone().bad(what))?;
    let to_world = DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), eye.extend(1.0));
    Ok(to_world.inverse())
}
