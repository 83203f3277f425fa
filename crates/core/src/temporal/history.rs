//! The last frames of a filter's input in a ring, each a row of numbers.

/// As many rows as the filter has taps; never reallocated once it is made.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    values: Vec<f32>,
    width: usize,
    length: usize,
    newest: usize,
}

impl History {
    /// `length >= 1` rows of `width` zeros.
    pub(super) fn new(length: usize, width: usize) -> Self {
        Self { values: vec![0.0; length * width], width, length, newest: 0 }
    }

    /// Drops the oldest row; the returned row becomes the newest and still holds the old values.
    pub(super) fn push(&mut self) -> &mut [f32] {
        self.newest = (self.newest + 1) % self.length;
        self.row_mut(self.newest)
    }

    /// Holds the newest row for one more frame.
    pub(super) fn repeat(&mut self) {
        let from = self.newest * self.width;
        self.newest = (self.newest + 1) % self.length;
        self.values.copy_within(from..from + self.width, self.newest * self.width);
    }

    /// The newest row, to be overwritten.
    pub(super) fn newest_mut(&mut self) -> &mut [f32] {
        self.row_mut(self.newest)
    }

    /// The row of `age` frames ago, `age < length`.
    pub(super) fn row(&self, age: usize) -> &[f32] {
        let row = (self.newest + self.length - age) % self.length;
        &self.values[row * self.width..(row + 1) * self.width]
    }

    fn row_mut(&mut self, row: usize) -> &mut [f32] {
        &mut self.values[row * self.width..(row + 1) * self.width]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_age_and_fall_out() {
        let mut history = History::new(3, 2);
        for value in 1..=4 {
            history.push().fill(value as f32);
        }
        assert_eq!([0, 1, 2].map(|age| history.row(age)[1]), [4.0, 3.0, 2.0]);
        history.repeat();
        assert_eq!([0, 1, 2].map(|age| history.row(age)[0]), [4.0, 4.0, 3.0]);
        history.newest_mut()[0] = 9.0;
        assert_eq!((history.row(0), history.row(1)), (&[9.0, 4.0][..], &[4.0, 4.0][..]));
    }
}
