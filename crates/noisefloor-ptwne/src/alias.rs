//! Choosing one of many with given probabilities.

/// Walker's alias table (Vose 1991): a column stands for itself below its threshold, else for its alias.
#[derive(Clone, Debug)]
pub(crate) struct AliasTable(Vec<(f32, u32)>);

impl AliasTable {
    /// A table for weights ≥ 0; uniform if all are zero.
    pub(crate) fn new(weights: &[f64]) -> Self {
        let n = weights.len();
        let total: f64 = weights.iter().sum();
        let share = |w: &f64| if total > 0.0 { w / total * n as f64 } else { 1.0 };
        let mut rest: Vec<f64> = weights.iter().map(share).collect();
        let mut table: Vec<(f32, u32)> = (0..n as u32).map(|i| (1.0, i)).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| rest[i] < 1.0);
        while let (Some(s), Some(&l)) = (small.pop(), large.last()) {
            table[s] = (rest[s] as f32, l as u32);
            rest[l] -= 1.0 - rest[s];
            if rest[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        Self(table)
    }

    /// An index, and the rest of the first number, which is uniform again. Both numbers are uniform in [0,
    /// 1); the second only extends the first, whose 24 bits are too few for large tables. The table must not
    /// be empty.
    #[inline]
    pub(crate) fn choose(&self, u: f32, more: f32) -> (usize, f32) {
        let x = (f64::from(u) + f64::from(more) * 2f64.powi(-24)) * self.0.len() as f64;
        let column = (x as usize).min(self.0.len() - 1);
        let (threshold, alias) = self.0[column];
        let rest = (x - column as f64) as f32;
        let (index, rest) = if rest < threshold {
            (column, rest / threshold)
        } else {
            (alias as usize, (rest - threshold) / (1.0 - threshold))
        };
        // Also false for NaN, from a threshold of one
        (index, if rest < 1.0 { rest } else { 1.0 - f32::EPSILON })
    }
}
