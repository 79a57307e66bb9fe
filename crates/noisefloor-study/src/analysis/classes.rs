//! Validation: how often pairs of each class are called identical (Takouachet et al. 2017, Table 2).

use super::interval::{Share, bootstrap};
use super::observers::Observer;
use crate::session::Class;
use serde::Serialize;

/// One column of the table.
#[derive(Clone, Debug, Serialize)]
pub struct ClassRow {
    /// What was shown.
    pub class: Class,
    /// Answers "identical".
    #[serde(flatten)]
    pub identical: Share,
    /// 95 % interval over observers: wider than Wilson's where answers of one observer are alike.
    pub observers_interval: Option<[f64; 2]>,
}

/// The table; empty without answers.
pub(super) fn rows(observers: &[&Observer], seed: u64) -> Vec<ClassRow> {
    let row = |class: Class| {
        let count = |o: &&Observer| {
            let of = o.judged.iter().filter(|(_, c, _)| *c == class);
            let identical = of.clone().filter(|(.., identical)| *identical);
            (identical.count(), of.count())
        };
        let counts: Vec<(usize, usize)> = observers.iter().map(count).collect();
        let (yes, of) = counts.iter().fold((0, 0), |(yes, of), c| (yes + c.0, of + c.1));
        let share = |weights: &[f64]| {
            let sum = |f: &dyn Fn(&(usize, usize)) -> usize| -> f64 {
                counts.iter().zip(weights).map(|(c, w)| f(c) as f64 * w).sum()
            };
            Some([sum(&|c| c.0) / sum(&|c| c.1)])
        };
        let identical = Share::new(yes, of)?;
        let observers_interval = bootstrap(counts.len(), seed, [identical.share], share).map(|[i]| i);
        Some(ClassRow { class, identical, observers_interval })
    };
    [Class::Reference, Class::Test, Class::Noisy].into_iter().filter_map(row).collect()
}
