use super::*;

fn layout(samples: Samples) -> Layout {
    Layout { samples, width: 64, height: 32, stride: samples.row_bytes(64), is_full_range: true }
}

#[test]
fn a_frame_of_jpeg_is_decoded_and_a_damaged_or_small_one_is_not_used() {
    let picture =
        ::image::RgbImage::from_fn(64, 32, |x, _| ::image::Rgb([if x < 32 { 20 } else { 220 }, 128, 60]));
    let mut bytes = io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ::image::ImageFormat::Jpeg).unwrap();
    let bytes = bytes.into_inner();
    let format = pixel_format::find(*b"MJPG").unwrap();
    let mut frame = Frame::default();
    assert_eq!(read(&bytes, format, &layout(Samples::Jpeg), &mut frame), None);
    let Pixels::Codes(codes) = &frame.pixels else { panic!("radiance") };
    assert_eq!((frame.width, frame.height, frame.channels, codes.len()), (64, 32, 3, 64 * 32 * 3));
    assert!(codes[0].abs_diff(20) < 6 && codes[3 * 60].abs_diff(220) < 6);
    let other = Layout { width: 32, ..layout(Samples::Jpeg) };
    for (bytes, layout) in
        [(&bytes[..20], layout(Samples::Jpeg)), (&[], layout(Samples::Jpeg)), (&bytes, other)]
    {
        assert_eq!(read(bytes, format, &layout, &mut frame), Some(BadBuffer::Undecodable));
    }
}

#[test]
fn a_short_buffer_is_not_used_and_a_mosaic_says_its_colours() {
    let format = pixel_format::find(*b"RG12").unwrap();
    let bytes = vec![1; 64 * 32 * 2];
    let mut frame = Frame { pixels: Pixels::Radiance(vec![1.0]), ..Frame::default() };
    assert_eq!(read(&bytes, format, &layout(format.samples), &mut frame), None);
    assert_eq!((frame.bayer, frame.channels), (format.bayer, 1));
    assert_eq!(frame.pixels, Pixels::Codes(vec![257; 64 * 32]));
    assert_eq!(read(&bytes[1..], format, &layout(format.samples), &mut frame), Some(BadBuffer::Short));
}
