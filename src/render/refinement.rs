//! Progressive refinement of a static picture: every further frame adds a sample to each pixel, until there
//! are enough.

/// The work of the next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Draw a new picture, see [`Renderer::draw`](super::Renderer::draw).
    Draw,
    /// Add a sample, see [`Renderer::refine`](super::Renderer::refine).
    Refine {
        /// Samples that the picture holds.
        drawn: u32,
    },
    /// Nothing: the picture has all its samples.
    Nothing,
}

/// Counts the samples of a picture.
#[derive(Clone, Debug)]
pub struct Refinement {
    per_frame: u32,
    most: u32,
    drawn: u32,
}

impl Refinement {
    /// Frames of a moving picture have `per_frame` samples per pixel (0 counts as 1); a static one gets up to
    /// `most`.
    pub fn new(per_frame: u32, most: u32) -> Self {
        Self { per_frame: per_frame.max(1), most, drawn: 0 }
    }

    /// Samples that the picture holds; 0 before the first.
    pub fn drawn(&self) -> u32 {
        self.drawn
    }

    /// The work of the next frame, which is then assumed to be done. `has_changed`: something visible has
    /// changed since the last frame.
    pub fn step(&mut self, has_changed: bool) -> Work {
        let drawn = self.drawn;
        if has_changed || drawn == 0 {
            self.drawn = self.per_frame;
            Work::Draw
        } else if drawn < self.most {
            self.drawn += 1;
            Work::Refine { drawn }
        } else {
            Work::Nothing
        }
    }

    /// Whether there is nothing to do until something changes.
    pub fn is_done(&self) -> bool {
        self.drawn > 0 && self.drawn >= self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_still_picture_is_refined_to_the_end_and_a_change_starts_it_anew() {
        let mut refinement = Refinement::new(1, 4);
        assert!(!refinement.is_done());
        assert_eq!(refinement.step(false), Work::Draw, "the first frame has nothing to refine");
        for drawn in 1..4 {
            assert!(!refinement.is_done());
            assert_eq!(refinement.step(false), Work::Refine { drawn });
        }
        assert!(refinement.is_done());
        assert_eq!((refinement.step(false), refinement.drawn()), (Work::Nothing, 4));
        assert_eq!((refinement.step(true), refinement.drawn()), (Work::Draw, 1));
        assert_eq!(refinement.step(false), Work::Refine { drawn: 1 });
    }

    #[test]
    fn frames_that_have_enough_samples_are_not_refined() {
        let mut refinement = Refinement::new(8, 4);
        assert_eq!((refinement.step(true), refinement.step(false)), (Work::Draw, Work::Nothing));
        assert_eq!((refinement.drawn(), refinement.is_done()), (8, true));
        assert_eq!(Refinement::new(0, 4).per_frame, 1);
    }
}
