/// Where the pixel centres of a lat-long picture lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LatLongCentres {
    /// Half a pixel inside the edge: column c of N lies at (c + 1/2) / N of the turn.
    #[default]
    Half,
    /// First and last centre on the poles and on +-pi: column c of N lies at c / (N - 1). OpenEXR files with
    /// the attribute `envmap` use this convention.
    Ends,
}
