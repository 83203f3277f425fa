use super::input::Input;
use super::panorama::{PanoramaArguments, map_shape, read_panorama};
use super::resolution::Resolution;
use crate::compare::{AnyExtractor, Inversion, Options, Sampler};
use crate::error::{Error, Result};
use crate::files::replace_file;
use crate::picture::draw_map;
use crate::wire::write_list_line;
use clap::ValueEnum;

use lightcast_core::light::error::ListError;
use lightcast_core::light::{self, ReferencedList};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Print the lights of one panorama.
///
/// INPUT is a lat-long panorama of the whole sphere, +Y up: OpenEXR or Radiance HDR, a file or `-` for
/// standard input. The result is one light list, a line of JSON, made by the same code that `run` uses for
/// every frame. It goes to standard output, or to --output.
///
/// Examples:
///   lightcast lights garden.hdr --lights 64 --hemisphere | jq .power
///   lightcast lights garden.hdr --output garden.jsonl --picture garden.png
///   lightcast lights - < garden.hdr
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The panorama, or `-` for standard input.
    input: PathBuf,

    /// Write the list to this file instead of standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Draw the map into this file (.png), with a ring for every light whose area is the light's share of the
    /// power.
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,

    /// Number of lights; samples are spread best at 2^k 3^m.
    #[arg(long, alias = "count", value_name = "N", default_value_t = 64)]
    lights: usize,

    /// How the map becomes lights.
    #[arg(long, value_enum, default_value_t = SamplerName::Refined)]
    sampler: SamplerName,

    /// Which inverse transform places the samples.
    #[arg(long, value_enum, default_value_t = InversionName::Bicontinuous)]
    inversion: InversionName,

    /// Take the upper half only.
    #[arg(long)]
    hemisphere: bool,

    /// Size of the polar map that the panorama is averaged to: azimuth steps x polar-angle steps [default:
    /// 360x180, with --hemisphere 360x90].
    #[arg(long, value_name = "COLUMNSxROWS")]
    resolution: Option<Resolution>,

    #[command(flatten)]
    panorama: PanoramaArguments,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum SamplerName {
    /// Cells about samples of luminance^0.75, each with its flux, mean direction and spread.
    Refined,
    /// As refined, with dominant peaks kept apart: the lights of `run` for a first frame.
    Adaptive,
    /// As refined: the lights of `run` for a first frame with persistent lights.
    Persistent,
    /// Lights of equal luminous power at the samples (Havran et al. 2005).
    EqualPower,
    /// Rectangles of equal energy (Debevec 2005).
    MedianCut,
    /// Rectangles of low variance (Viriyothai and Debevec 2009).
    VarianceMinimisation,
    /// Strata of connected pixels of similar radiance (Agarwal et al. 2003).
    Structured,
    /// Cells about relaxed sites whose number grows (Kollig and Keller 2003).
    KolligKeller,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum InversionName {
    /// Continuous in both directions, over the concentric map (Havran et al. 2003), rows interpolated as they
    /// are.
    Bicontinuous,
    /// The same with rows normalised before, as the paper has it.
    NormalisedRows,
    /// Row, then column within the row.
    Standard,
}

impl From<SamplerName> for Sampler {
    fn from(name: SamplerName) -> Self {
        match name {
            SamplerName::Refined => Self::Live(light::Sampler::Refined),
            SamplerName::Adaptive => Self::Live(light::Sampler::Adaptive),
            SamplerName::Persistent => Self::Live(light::Sampler::Persistent),
            SamplerName::EqualPower => Self::Live(light::Sampler::EqualPower),
            SamplerName::MedianCut => Self::MedianCut,
            SamplerName::VarianceMinimisation => Self::VarianceMinimisation,
            SamplerName::Structured => Self::Structured,
            SamplerName::KolligKeller => Self::KolligKeller,
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let panorama = Input::panorama(&arguments.input, "lights")?;
    let picture = arguments.picture.as_deref().map(png).transpose()?;
    let shape = map_shape(arguments.resolution, arguments.hemisphere)?;
    let map = read_panorama(&panorama, arguments.panorama, shape)?;
    let options = Options {
        count: arguments.lights,
        sampler: arguments.sampler.into(),
        inversion: match arguments.inversion {
            InversionName::Bicontinuous => Inversion::Bicontinuous,
            InversionName::NormalisedRows => Inversion::NormalisedRows,
            InversionName::Standard => Inversion::Standard,
        },
    };
    let mut list = ReferencedList::default();
    AnyExtractor::new(map.shape, &options)?.step(&map, &mut list);
    ListError::new().measure(&mut list);
    if let Some(path) = picture {
        draw_map(&map, &list.list.lights).write(path)?;
    }
    let failed = |error: io::Error| Error::failed("cannot be written").because(error);
    match &arguments.output {
        Some(path) => replace_file(path, |writer| write_list_line(&list.list, writer).map_err(failed)),
        None => match write_list_line(&list.list, io::stdout().lock()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(failed(error).at("standard output")),
            _ => Ok(()),
        },
    }
}

/// The name of a picture that can be drawn.
fn png(path: &Path) -> Result<&Path> {
    let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if is_png {
        Ok(path)
    } else {
        Err(Error::usage("--picture draws a PNG file; give it a name that ends in .png").at(path))
    }
}
