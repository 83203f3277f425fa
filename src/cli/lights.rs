use super::panorama::{map_shape, read_panorama};
use super::resolution::Resolution;
use crate::compare::{AnyExtractor, Inversion, Options, Sampler};
use crate::error::{Error, Result};
use crate::wire::write_list_line;
use clap::ValueEnum;

use lightcast_core::light::error::ListError;
use lightcast_core::light::{self, ReferencedList};
use std::io::{self, ErrorKind};
use std::path::PathBuf;

/// Print the lights of one panorama.
///
/// MAP is a lat-long panorama of the whole sphere, +Y up: OpenEXR or Radiance HDR. The result is one light list, a
/// line of JSON on standard output, made by the same code that `run` uses for every frame.
///
/// Example: lightcast lights garden.hdr --count 64 --hemisphere | jq .power
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The panorama.
    map: PathBuf,

    /// Number of lights; samples are spread best at 2^k 3^m.
    #[arg(long, value_name = "N", default_value_t = 64)]
    count: usize,

    /// How the map becomes lights.
    #[arg(long, value_enum, default_value_t = SamplerName::Refined)]
    sampler: SamplerName,

    /// Which inverse transform places the samples.
    #[arg(long, value_enum, default_value_t = InversionName::Bicontinuous)]
    inversion: InversionName,

    /// Take the upper half only.
    #[arg(long)]
    hemisphere: bool,

    /// Size of the polar map that the panorama is averaged to: azimuth steps x polar-angle steps
    /// [default: 360x180, with --hemisphere 360x90].
    #[arg(long, value_name = "COLUMNSxROWS")]
    resolution: Option<Resolution>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum SamplerName {
    /// Cells about samples of luminance^0.75, each with its flux, mean direction and spread.
    Refined,
    /// As refined, with dominant peaks apart: what `run` makes of a first frame.
    Adaptive,
    /// As refined: what `run` makes of a first frame with persistent lights.
    Persistent,
    /// Lights of equal luminous power at the samples (Havran et al. 2005).
    EqualPower,
    /// Rectangles of even energy (Debevec 2005).
    MedianCut,
    /// Rectangles of little variance (Viriyothai and Debevec 2009).
    VarianceMinimisation,
    /// Strata of connected pixels of alike radiance (Agarwal et al. 2003).
    Structured,
    /// Cells about relaxed sites whose number grows (Kollig and Keller 2003).
    KolligKeller,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum InversionName {
    /// Continuous in both directions, over the concentric map (Havran et al. 2003), rows interpolated as they are.
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
    let shape = map_shape(arguments.resolution, arguments.hemisphere)?;
    let map = read_panorama(&arguments.map, shape)?;
    let options = Options {
        count: arguments.count,
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
    match write_list_line(&list.list, io::stdout().lock()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Error::failed("standard output cannot be written").because(error))
        }
        _ => Ok(()),
    }
}
