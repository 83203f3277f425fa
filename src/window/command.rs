use winit::keyboard::{Key, NamedKey};

/// A command given by a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    Freeze,
    Inset,
    Timings,
    Reset,
    MoreLights,
    FewerLights,
    Save,
    Help,
    Close,
}

/// The keys and mouse actions of the window, as help text.
pub const KEYS: &str = "\
drag left      turn round the scene
drag right     move sideways, as Shift and drag left do
wheel          go nearer or away
Space          freeze the lights, or let them go on
i              show or hide the map of the lights
t              show or hide the timings in the title; also prints the times of the passes
r              back to the first camera
+, -           more or fewer lights, up to --lights
s              save the picture as picture_N.png
h, F1          print these keys
q, Escape      close
";

impl Command {
    /// The command of a key; upper and lower case are equivalent.
    pub fn of(key: &Key) -> Option<Self> {
        match key {
            Key::Named(NamedKey::Space) => Some(Self::Freeze),
            Key::Named(NamedKey::Escape) => Some(Self::Close),
            Key::Named(NamedKey::F1) => Some(Self::Help),
            Key::Character(text) => match text.to_lowercase().as_str() {
                " " => Some(Self::Freeze),
                "i" => Some(Self::Inset),
                "t" => Some(Self::Timings),
                "r" => Some(Self::Reset),
                // On many keyboards + and = are on the same key.
                "+" | "=" => Some(Self::MoreLights),
                "-" => Some(Self::FewerLights),
                "s" => Some(Self::Save),
                "h" => Some(Self::Help),
                "q" => Some(Self::Close),
                _ => None,
            },
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_that_is_printed_does_something() {
        for line in KEYS.lines().filter(|line| !line.starts_with("drag") && !line.starts_with("wheel")) {
            let (names, _) = line.split_at(15);
            for name in names.split(',').map(str::trim) {
                let key = match name {
                    "Space" => Key::Named(NamedKey::Space),
                    "Escape" => Key::Named(NamedKey::Escape),
                    "F1" => Key::Named(NamedKey::F1),
                    letter => Key::Character(letter.into()),
                };
                assert!(Command::of(&key).is_some(), "{name}");
            }
        }
    }

    #[test]
    fn letters_of_either_case_and_no_others() {
        let of = |text: &str| Command::of(&Key::Character(text.into()));
        assert_eq!((of("q"), of("Q")), (Some(Command::Close), Some(Command::Close)));
        assert_eq!(of("s"), Some(Command::Save));
        assert_eq!((of("x"), of("qq"), of("")), (None, None, None));
        assert_eq!(Command::of(&Key::Named(NamedKey::Enter)), None);
    }
}
