/// Where the pixel centres of a lat-long picture lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LatLongCentres {
    /// Half a pixel inside the borders: column i of N is centred at `(i + 1/2) / N` of a turn.
    #[default]
    Half,
    /// On the borders: column i of N is centred at `i / (N - 1)`, so the first and the last column both stand
    /// on the seam and the first and the last row on the poles. OpenEXR files with an `envmap` attribute.
    Ends,
}
