//! A search over several pictures, or over parts of large ones.

use super::{Ending, Excess, Knob, KnobError, Next, Step, Tuning};
use crate::tile::Tile;

/// Edge of crops, in pixels: a square that is judged, and half of one around it.
const CROP: usize = 128;

/// A picture that two seeds are to be rendered of, and judged.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Look {
    /// What each of the two is rendered with.
    pub each: f64,
    /// One picture with this setting would be as good as their mean, if noise follows the setting.
    pub setting: f64,
    /// The number of the view, such as a frame of a sequence.
    pub view: usize,
    /// A part of it, to be judged as a picture of its own; `None` for the whole.
    pub crop: Option<Tile>,
    /// Whether nothing is to be rendered: the crop is cut from the pictures of the whole view that were rendered just before,
    /// with the same setting.
    pub is_rendered: bool,
}

/// Runs a search to its end. `look` renders two pictures with [`Look::each`], each with a seed of its own and the same seeds in
/// every step, and returns what was found in the worst place, and in the [squares](super::Looked::squares) of the picture if
/// crops are wanted.
///
/// ```
/// use noisefloor::tune::{Ending, Excess, Knob, Search, drive};
///
/// let mut search = Search::new(Knob::Threshold { coarsest: 0.1, finest: 0.001 })?.with_views(3);
/// // The frame with number 1 is the hardest
/// let enough = [0.05, 0.02, 0.04];
/// let ending = drive(&mut search, |look| {
///     Ok::<_, std::io::Error>((Excess::new(look.setting / enough[look.view]), Vec::new()))
/// })?;
/// assert_eq!(search.views(), [1, 2, 0]);
/// assert!(matches!(ending, Ending::Found { setting, .. } if setting > 0.01 && setting <= 0.02));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Those of `look`. The search can go on afterwards.
pub fn drive<E>(
    search: &mut Search,
    mut look: impl FnMut(&Look) -> Result<(Excess, Vec<(Tile, f64)>), E>,
) -> Result<Ending, E> {
    while let Some(next) = search.next() {
        let (excess, squares) = look(&next)?;
        search.tell(excess, &squares);
    }
    match search.tuning.next() {
        Next::Done(ending) => Ok(ending),
        Next::Render(_) => unreachable!("a search that asks for nothing has ended"),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    view: usize,
    crop: Option<Tile>,
}

#[derive(Clone, Debug, PartialEq)]
struct Seen {
    place: Place,
    excess: Excess,
    squares: Vec<(Tile, f64)>,
}

/// What the looks are for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Purpose {
    /// All whole views, with the first setting.
    First,
    /// Crops of pictures that have been rendered, as they are judged from now on. `worst`: of the whole.
    Closer { worst: f64 },
    /// The next setting: hardest places first, until one fails.
    Step,
    /// The setting that was enough for crops: whole views, until one fails.
    Again,
}

/// A search of a renderer's setting in one or several views.
///
/// With the first setting, the search looks at all views as a whole. With later settings, it begins with the hardest view and
/// stops at the first one that fails. In large views, crops around the worst squares can stand for the whole. The setting that is
/// enough for the crops is then tried on the whole view; if it fails there, the search goes on in other crops.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    tuning: Tuning,
    crops: usize,
    purpose: Purpose,
    /// What is looked at, hardest first, and what was found so far.
    places: Vec<Place>,
    seen: Vec<Seen>,
    /// All views, hardest first.
    views: Vec<usize>,
    /// The crops that stood for the whole, last.
    stood: Vec<(usize, Tile)>,
}

impl Search {
    /// A search that has not begun, in one view as a whole.
    ///
    /// # Errors
    /// [`KnobError`] if the range is empty.
    pub fn new(knob: Knob) -> Result<Self, KnobError> {
        let (tuning, places, stood) = (Tuning::new(knob)?, Vec::new(), Vec::new());
        let search = Self {
            tuning,
            crops: 0,
            purpose: Purpose::First,
            places,
            seen: Vec::new(),
            views: vec![0],
            stood,
        };
        Ok(search.ordered(&[]))
    }

    /// The same over this number of views, such as frames of a sequence: 1 at the least.
    #[must_use]
    pub fn with_views(self, views: usize) -> Self {
        Self { views: (0..views.max(1)).collect(), ..self }.ordered(&[])
    }

    /// The same where at most this number of crops stand for a view; 0 for none.
    #[must_use]
    pub fn with_crops(self, crops: usize) -> Self {
        Self { crops, ..self }
    }

    /// As many crops as stand for a picture of this size, if they are to have no more than a third of its pixels: 4 at most, 0
    /// if it is small.
    pub fn crops_for((width, height): (usize, usize)) -> usize {
        (width.saturating_mul(height) / (3 * CROP * CROP)).min(4)
    }

    /// The same with these views first, in this order: hardest first, as found by an earlier search.
    #[must_use]
    pub fn ordered(mut self, hardest: &[usize]) -> Self {
        self.views = first(hardest.iter().copied().filter(|view| self.views.contains(view)), &self.views);
        self.places = self.whole();
        self
    }

    /// Takes over a step of an earlier search: its setting, and what was found. Returns whether this search would have tried the
    /// same, and has taken it; with another range, it may go another way from some step on.
    pub fn repeat(&mut self, setting: f64, excess: Excess) -> bool {
        let tries_it =
            matches!(self.tuning.next(), Next::Render(each) if self.knob().of_both(each) == setting);
        if tries_it {
            self.tuning.tell(excess);
            self.purpose = Purpose::Step;
        }
        tries_it
    }

    /// What is searched.
    pub fn knob(&self) -> Knob {
        self.tuning.knob
    }

    /// What was tried, in order: each [`Look::setting`], with what was found in the worst place.
    pub fn steps(&self) -> impl DoubleEndedIterator<Item = (f64, Excess)> {
        self.tuning.steps.iter().map(move |step| (self.knob().of_both(step.each), step.excess))
    }

    /// How it ended; `None` before that.
    pub fn ending(&self) -> Option<Ending> {
        match (self.next(), self.tuning.next()) {
            (None, Next::Done(ending)) => Some(ending),
            _ => None,
        }
    }

    /// All views, hardest first as far as it is known.
    pub fn views(&self) -> &[usize] {
        &self.views
    }

    /// The latest crops that have stood for whole views, hardest first: view and place.
    pub fn crops(&self) -> &[(usize, Tile)] {
        &self.stood
    }

    /// What to look at next; `None` at the end. The same until [`Search::tell`].
    pub fn next(&self) -> Option<Look> {
        let (each, setting) = match (self.purpose, self.tuning.next(), self.tuning.steps.last()) {
            // The mean of two is as good as one with the setting that was enough alone in the crops
            (Purpose::Again, Next::Done(Ending::Found { setting, .. }), _) => {
                (self.knob().of_each(setting), setting)
            }
            (Purpose::Closer { .. }, _, Some(&Step { each, .. })) | (_, Next::Render(each), _) => {
                (each, self.knob().of_both(each))
            }
            (_, Next::Done(_), _) => return None,
        };
        let Place { view, crop } = *self.places.get(self.seen.len())?;
        let is_rendered = matches!(self.purpose, Purpose::Closer { .. });
        Some(Look { each, setting, view, crop, is_rendered })
    }

    /// Reports the look that [`Search::next`] asked for: the worst place, and, if crops are wanted, all
    /// [squares](super::Looked::squares) of the picture. Returns whether it was the last look with this setting, for now. After the
    /// end, nothing happens.
    pub fn tell(&mut self, excess: Excess, squares: &[(Tile, f64)]) -> bool {
        let Some(look) = self.next() else { return true };
        let place = Place { view: look.view, crop: look.crop };
        self.seen.push(Seen { place, excess, squares: squares.to_vec() });
        let goes_on = match self.purpose {
            Purpose::First | Purpose::Closer { .. } => true,
            // The others need no look once one has failed
            Purpose::Step => self.tuning.enough(look.each, &excess).is_some(),
            Purpose::Again => excess.ratio <= 1.0,
        };
        if self.seen.len() < self.places.len() && goes_on {
            return false;
        }
        let mut seen = std::mem::take(&mut self.seen);
        seen.sort_by(|a, b| b.excess.ratio.total_cmp(&a.excess.ratio));
        if place.crop.is_some() {
            let seen = seen.iter().filter_map(|seen| Some((seen.place.view, seen.place.crop?)));
            self.stood = first(seen, &self.parts());
        }
        self.views = first(seen.iter().map(|seen| seen.place.view), &self.views);
        let Seen { place, mut excess, .. } = seen[0];
        // What is worst in two pictures need not be worst in one
        let finer = seen.iter().map(|seen| seen.excess.of_finer()).fold(0.0, f64::max);
        excess.alone = excess.alone.map(|_| finer);
        excess.floor = seen.iter().map(|seen| seen.excess.floor).fold(0.0, f64::max);
        match self.purpose {
            Purpose::First => {
                let crops = self.choose(&seen);
                let mut whole = self.tuning.clone();
                whole.tell(excess);
                if !crops.is_empty() && matches!(whole.next(), Next::Render(_)) {
                    (self.places, self.purpose) = (crops, Purpose::Closer { worst: excess.ratio });
                    return false;
                }
                self.tuning = whole;
                self.go_on(&seen);
            }
            Purpose::Closer { worst } => {
                if self.tuning.steps.is_empty() {
                    // What is seen in the whole is there
                    excess.ratio = excess.ratio.max(worst);
                    self.tuning.tell(excess);
                }
                (self.places, self.purpose) = (seen.iter().map(|seen| seen.place).collect(), Purpose::Step);
            }
            Purpose::Step => {
                self.tuning.tell(excess);
                self.go_on(&seen);
                let found = matches!(self.tuning.next(), Next::Done(Ending::Found { .. }));
                if found && place.crop.is_some() {
                    (self.places, self.purpose) = (self.whole(), Purpose::Again);
                }
            }
            Purpose::Again => {
                self.purpose = Purpose::Step;
                if excess.ratio <= 1.0 {
                    return true;
                }
                self.tuning.reopen(look.each, excess);
                let crops = self.choose(&seen);
                self.go_on(&seen);
                if matches!(self.tuning.next(), Next::Render(_)) && !crops.is_empty() {
                    (self.places, self.purpose) = (crops, Purpose::Closer { worst: excess.ratio });
                    return false;
                }
            }
        }
        true
    }

    /// After a step: those that were seen first, worst first.
    fn go_on(&mut self, seen: &[Seen]) {
        self.places = first(seen.iter().map(|seen| seen.place), &self.places);
        self.purpose = Purpose::Step;
    }

    fn parts(&self) -> Vec<(usize, Tile)> {
        self.places.iter().filter_map(|place| Some((place.view, place.crop?))).collect()
    }

    fn whole(&self) -> Vec<Place> {
        self.views.iter().map(|&view| Place { view, crop: None }).collect()
    }

    /// Crops around the worst squares, none of them in the middle of another.
    fn choose(&self, seen: &[Seen]) -> Vec<Place> {
        let mut all: Vec<(usize, [usize; 2], Tile, f64)> = Vec::new();
        for of in seen {
            let ends = of.squares.iter().map(|(square, _)| {
                [square.x.saturating_add(square.width), square.y.saturating_add(square.height)]
            });
            let size = ends.fold([0; 2], |[x, y], end| [x.max(end[0]), y.max(end[1])]);
            all.extend(of.squares.iter().map(|&(square, ratio)| (of.place.view, size, square, ratio)));
        }
        all.sort_by(|a, b| b.3.total_cmp(&a.3));
        let mut crops: Vec<Place> = Vec::new();
        for (view, [width, height], square, _) in all {
            if crops.len() == self.crops {
                break;
            }
            let start = |at: usize, edge: usize, side: usize| {
                (at + edge / 2).saturating_sub(CROP / 2).min(side.saturating_sub(CROP))
            };
            let (x, y) = (start(square.x, square.width, width), start(square.y, square.height, height));
            let tile = Tile { index: 0, x, y, width: CROP.min(width), height: CROP.min(height) };
            let place = Place { view, crop: Some(tile) };
            let apart = |other: &Place| {
                other.view != place.view
                    || other.crop.is_none_or(|other| {
                        other.x.abs_diff(x) >= CROP / 2 || other.y.abs_diff(y) >= CROP / 2
                    })
            };
            if crops.iter().all(apart) {
                crops.push(place);
            }
        }
        crops
    }
}

/// Those, each once, and then the others.
fn first<T: Copy + PartialEq>(those: impl Iterator<Item = T>, others: &[T]) -> Vec<T> {
    let mut all = Vec::with_capacity(others.len());
    for one in those.chain(others.iter().copied()) {
        if !all.contains(&one) {
            all.push(one);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::squares;
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::SQRT_2;

    const SIZE: (usize, usize) = (640, 384);
    const KNOB: Knob = Knob::Threshold { coarsest: 0.2, finest: 1e-6 };

    /// What is wrong in a square of the view, with a threshold.
    type Law<'a> = &'a dyn Fn(usize, &Tile, f64) -> f64;

    /// The looks of a search, and how it ended.
    fn search(views: usize, crops: usize, law: Law<'_>) -> (Vec<Look>, Search) {
        let mut search = Search::new(KNOB).unwrap().with_views(views).with_crops(crops);
        let mut looks = Vec::new();
        while let Some(look) = search.next() {
            looks.push(look);
            assert!(looks.len() < 100, "no end: {looks:?}");
            let inside = |square: &Tile| {
                look.crop.is_none_or(|crop| {
                    square.x >= crop.x
                        && square.y >= crop.y
                        && square.x + square.width <= crop.x + crop.width
                        && square.y + square.height <= crop.y + crop.height
                })
            };
            let all = squares(SIZE).into_iter().filter(inside);
            let found: Vec<_> = all.map(|square| (square, law(look.view, &square, look.setting))).collect();
            let worst = found.iter().map(|(_, ratio)| *ratio).fold(0.0, f64::max);
            search.tell(Excess::new(worst), &found);
        }
        (looks, search)
    }

    fn enough(search: &Search) -> f64 {
        let Some(Ending::Found { setting, .. }) = search.ending() else { panic!("{search:?}") };
        setting
    }

    #[test]
    fn the_whole_is_rendered_first_and_last_and_crops_in_between() {
        // The lower right is the hardest
        let law = |_: usize, square: &Tile, t: f64| {
            let hard = square.x >= 500 && square.y >= 300;
            (t / if hard { 0.004 } else { 0.1 }).powf(0.6)
        };
        let (looks, found) = search(1, 2, &law);
        let rendered: Vec<_> = looks.iter().filter(|look| !look.is_rendered).collect();
        let whole = |look: &Look| look.crop.is_none();
        assert!(whole(rendered[0]) && whole(rendered[rendered.len() - 1]), "{looks:?}");
        assert!(rendered.len() > 3 && rendered.iter().filter(|look| whole(look)).count() == 2, "{looks:?}");
        // Cut from the first pictures
        assert!(looks[1].is_rendered && looks[2].is_rendered && looks[1].setting == 0.2);
        // The middle of one of the worst squares
        let crop = looks[1].crop.unwrap();
        assert!(crop.x >= 480 && (crop.y, crop.width, crop.height) == (256, CROP, CROP), "{crop:?}");
        assert!(enough(&found) <= 0.004);
    }

    #[test]
    fn what_is_enough_at_once_has_one_look() {
        let (looks, found) = search(1, 4, &|_, _, t| t / 0.3);
        assert_eq!((looks.len(), enough(&found)), (1, 0.2));
    }

    #[test]
    fn a_place_that_gets_better_more_slowly_is_noticed_in_the_end() {
        let law = |_: usize, square: &Tile, t: f64| {
            // Hard at first, and hard to the end
            if square.x < 64 {
                9.0 * t / 0.2
            } else if square.x >= 500 {
                3.0 * (t / 0.2).powf(0.4)
            } else {
                0.1
            }
        };
        let (looks, found) = search(1, 1, &law);
        let last = looks[looks.len() - 1];
        assert!(last.crop.is_none() && last.setting == enough(&found));
        assert!(3.0 * (last.setting / 0.2).powf(0.4) <= 1.0, "{looks:?}");
        assert!(looks.iter().any(|look| look.crop.is_some_and(|crop| crop.x >= 448)), "{looks:?}");
    }

    #[test]
    fn an_earlier_search_goes_on_with_the_views_in_its_order() {
        let mut search = Search::new(KNOB).unwrap().with_views(3).ordered(&[2, 7]);
        assert!(!search.repeat(0.3, Excess::new(4.0)) && search.repeat(0.2, Excess::new(4.0)));
        assert_eq!(search.views(), [2, 0, 1]);
        let look = search.next().unwrap();
        assert!(look.view == 2 && look.setting < 0.2);
        assert!(search.tell(Excess::new(2.0), &[]));
        assert_eq!(search.steps().map(|(_, excess)| excess.ratio).collect::<Vec<_>>(), [4.0, 2.0]);
    }

    #[test]
    fn crops_are_a_small_part() {
        for (size, crops) in
            [((240, 135), 0), ((320, 180), 1), ((480, 270), 2), ((960, 540), 4), ((1920, 1080), 4)]
        {
            assert_eq!(Search::crops_for(size), crops);
            assert!(crops * CROP * CROP * 3 <= size.0 * size.1);
        }
        assert_eq!(Search::crops_for((usize::MAX, 2)), 4);
    }

    proptest! {
        /// Whatever gets better how fast in which place of which view: what is found is enough for the whole of each.
        #[test]
        fn what_is_found_is_enough_everywhere(
            views in 1..4usize,
            crops in 0..5usize,
            hard in prop::collection::vec((0.1..12.0f64, 0.2..0.9f64), 40),
        ) {
            let law = |view: usize, square: &Tile, t: f64| {
                let (excess, power) = hard[(7 * view + square.x / 100 + 11 * (square.y / 100)) % hard.len()];
                excess * (t / 0.2).powf(2.0 * power)
            };
            let (_, found) = search(views, crops, &law);
            let t = enough(&found);
            if crops == 0 {
                // What was told can be told again, as when a search is resumed
                let mut again = Search::new(KNOB).unwrap().with_views(views);
                for (setting, excess) in found.steps() {
                    prop_assert!(again.repeat(setting, excess));
                }
                prop_assert_eq!(again.ending(), found.ending());
            }
            for view in 0..views {
                for square in squares(SIZE) {
                    // Each of two whole pictures was enough, or their mean after crops that were enough alone
                    let left = if crops == 0 {
                        law(view, &square, t / SQRT_2) * SQRT_2
                    } else {
                        law(view, &square, t)
                    };
                    prop_assert!(left <= 1.0 + 1e-9);
                }
            }
        }
    }
}
