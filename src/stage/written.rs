use lightcast_core::light::LightList;
use std::path::Path;

/// Counts the pictures of a stage, so that a run that gives none says why.
#[derive(Debug, Default)]
pub(super) struct Written {
    lists: u64,
    filter_delay_frames: u32,
    pictures: u64,
}

impl Written {
    pub fn saw(&mut self, list: &LightList) {
        self.lists += 1;
        self.filter_delay_frames = list.filter_delay_frames;
    }

    pub fn count(&mut self) {
        self.pictures += 1;
    }

    /// Logs, at the end, that `folder` has got no picture because the sequence is no longer than the filter's
    /// delay.
    pub fn tell(&self, folder: &Path) {
        if let Some(message) = self.message() {
            tracing::warn!("{}: {message}", folder.display());
        }
    }

    fn message(&self) -> Option<String> {
        let Self { lists, filter_delay_frames: delay, pictures } = *self;
        (pictures == 0 && lists > 0 && lists <= u64::from(delay)).then(|| {
            format!(
                "no picture was drawn: the filter gives the lights of a frame {delay} frames later, and only {lists} came; \
                 set enabled = false in [filter] for so short a sequence"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_few_lists_for_the_filter_are_told_and_nothing_else() {
        let written = |lists, filter_delay_frames, pictures| Written { lists, filter_delay_frames, pictures };
        let message = written(3, 4, 0).message().unwrap();
        assert!(message.contains("4 frames later, and only 3 came"), "{message}");
        assert!(written(4, 4, 0).message().is_some());
        for quiet in
            [written(0, 0, 0), written(5, 4, 1), written(1, 0, 1), written(2, 4, 2), written(9, 4, 0)]
        {
            assert_eq!(quiet.message(), None, "{quiet:?}");
        }
    }
}
