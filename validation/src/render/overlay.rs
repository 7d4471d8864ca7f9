//! Snapshots of a prediction over the truth, as in the paper's Fig. 10: the truth in grey, predicted
//! points coloured by their squared distance from it.

use dempm::trajectory::Frame;
use miette::IntoDiagnostic;

use crate::render::figure::Picture;

/// What part of the plane is drawn, and how large.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Width and height of the part that is shown, from the origin, m.
    pub size: [f64; 2],
    /// Diameter of a point, m.
    pub spacing: f64,
    /// Width of the domain, m: the unit of errors.
    pub box_width: f64,
    /// Width of the picture, pixels.
    pub width: u32,
}

/// A picture of few colours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Index into [`PALETTE`] of each pixel, row by row from the top.
    pub pixels: Vec<u8>,
}

/// Background, truth, obstacles, and a colour for each step of the squared distance. At most sixteen
/// colours without shades keep files small.
pub const PALETTE: [[u8; 3]; 13] = [
    [255, 255, 255],
    [200, 200, 196],
    [110, 110, 106],
    [44, 62, 140],
    [49, 100, 176],
    [66, 138, 190],
    [96, 175, 188],
    [150, 203, 170],
    [235, 222, 120],
    [246, 190, 70],
    [236, 138, 54],
    [213, 78, 48],
    [166, 22, 44],
];
const PAPER: u8 = 0;
const TRUTH: u8 = 1;
const SOLID: u8 = 2;
const FIRST: u8 = 3;
/// Squared distances, box width 1, at the two ends of the colours.
pub const RANGE: [f64; 2] = [1e-8, 1e-3];
/// Points of these diameters (pixels) and below are drawn as squares.
const SMALL: f64 = 6.0;

impl Image {
    fn new(width: u32, height: u32) -> Self {
        Self { width, height, pixels: vec![PAPER; (width * height) as usize] }
    }

    /// Index into [`PALETTE`] of a pixel.
    pub fn pixel(&self, column: u32, row: u32) -> u8 {
        self.pixels[(row * self.width + column) as usize]
    }

    fn put(&mut self, column: u32, row: u32, colour: u8) {
        self.pixels[(row * self.width + column) as usize] = colour;
    }
}

impl View {
    /// The part of the domain that frames touch.
    pub fn of<'a>(
        frames: impl IntoIterator<Item = &'a Frame>,
        spacing: f64,
        domain: [f64; 2],
    ) -> Self {
        let mut size = [spacing; 2];
        for x in frames.into_iter().flat_map(|frame| &frame.position) {
            for k in 0..2 {
                size[k] = size[k].max(x[k]);
            }
        }
        let size = [0, 1].map(|k| (size[k] + 2.0 * spacing).min(domain[k]));
        Self { size, spacing, box_width: domain[0], width: 720 }
    }

    fn scale(&self) -> f64 {
        f64::from(self.width) / self.size[0]
    }

    fn height(&self) -> u32 {
        (self.size[1] * self.scale()).ceil() as u32
    }

    /// Whether two such pictures are better placed side by side.
    pub fn is_high(&self) -> bool {
        self.size[1] > 0.45 * self.size[0]
    }

    /// One prediction over the truth.
    pub fn draw(&self, predicted: &[[f64; 2]], truth: &Frame) -> Image {
        let mut image = Image::new(self.width, self.height() + 2);
        for [x0, y0, x1, y1] in &truth.boxes {
            self.rectangle(&mut image, [*x0, *y0], [*x1, *y1]);
        }
        for x in &truth.position {
            self.point(&mut image, *x, 1.0, TRUTH);
        }
        for (p, t) in predicted.iter().zip(&truth.position) {
            let square = ((p[0] - t[0]).powi(2) + (p[1] - t[1]).powi(2)) / self.box_width.powi(2);
            self.point(&mut image, *p, 0.75, colour(square));
        }
        // The floor.
        for row in self.height()..self.height() + 2 {
            (0..self.width).for_each(|column| image.put(column, row, SOLID));
        }
        image
    }

    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [x * self.scale(), f64::from(self.height()) - y * self.scale()]
    }

    /// A disc, or a square where a disc would be a few pixels wide.
    fn point(&self, image: &mut Image, place: [f64; 2], part: f64, colour: u8) {
        let [x, y] = self.place(place);
        let diameter = self.spacing * self.scale();
        let small = diameter <= SMALL;
        let radius = if small { 0.5 * diameter.ceil() } else { 0.5 * part * diameter };
        let whole = |from: f64| {
            (from.floor().max(0.0) as u32, (from + 2.0 * radius).ceil().max(0.0) as u32)
        };
        let (columns, rows) = (whole(x - radius), whole(y - radius));
        for row in rows.0..rows.1.min(self.height()) {
            for column in columns.0..columns.1.min(self.width) {
                let from = [f64::from(column) + 0.5 - x, f64::from(row) + 0.5 - y];
                if small || from[0].hypot(from[1]) <= radius {
                    image.put(column, row, colour);
                }
            }
        }
    }

    fn rectangle(&self, image: &mut Image, low: [f64; 2], high: [f64; 2]) {
        let ([left, bottom], [right, top]) = (self.place(low), self.place(high));
        // Casting saturates and turns what is absent (NaN) into nothing.
        for row in top as u32..(bottom as u32).min(self.height()) {
            for column in left as u32..(right as u32).min(self.width) {
                image.put(column, row, SOLID);
            }
        }
    }
}

/// Pictures of the same size in a grid with so many columns, as PNG.
///
/// # Errors
/// If they cannot be encoded.
pub fn in_rows(images: &[Image], columns: u32) -> miette::Result<Picture> {
    const GAP: u32 = 14;
    let (width, height) = images.first().map_or((1, 1), |image| (image.width, image.height));
    let rows = (images.len() as u32).div_ceil(columns);
    let mut whole =
        Image::new(columns * (width + GAP) - GAP, (rows * (height + GAP)).max(GAP + 1) - GAP);
    for (image, place) in images.iter().zip(0..) {
        let (left, top) = (place % columns * (width + GAP), place / columns * (height + GAP));
        for row in 0..height {
            for column in 0..width {
                whole.put(left + column, top + row, image.pixel(column, row));
            }
        }
    }
    Ok(Picture::Png(png(whole.width, &whole.pixels).into_diagnostic()?))
}

/// A PNG of four bits a pixel.
fn png(width: u32, pixels: &[u8]) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let height = pixels.len() as u32 / width;
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Four);
    encoder.set_palette(PALETTE.as_flattened());
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::NoFilter);
    // Two pixels a byte, each row from a new byte on.
    let pairs = |row: &[u8]| -> Vec<u8> {
        row.chunks(2).map(|pair| pair[0] << 4 | pair.get(1).unwrap_or(&0)).collect()
    };
    let packed: Vec<u8> = pixels.chunks(width as usize).flat_map(pairs).collect();
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&packed)?;
    writer.finish()?;
    Ok(bytes)
}

/// The place of the colour of a squared distance: from blue over yellow to red, in steps of the
/// logarithm.
fn colour(square: f64) -> u8 {
    let steps = PALETTE.len() as u8 - FIRST;
    let [low, high] = RANGE.map(f64::ln);
    let place = (square.max(RANGE[0]).ln() - low) / (high - low) * f64::from(steps);
    FIRST + (place as u8).min(steps - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_right_prediction_is_blue_over_grey_and_a_wrong_one_red() {
        let truth = Frame { position: vec![[0.5, 0.5], [1.5, 0.5]], ..Frame::default() };
        let view = View { size: [3.0, 1.0], spacing: 1.0, box_width: 1.0, width: 300 };
        let image = view.draw(&[[0.5, 0.5], [2.5, 0.5]], &truth);
        assert_eq!(image.pixel(50, 50), FIRST);
        assert_eq!(image.pixel(150, 50), TRUTH);
        assert_eq!(image.pixel(250, 50), PALETTE.len() as u8 - 1);
        assert_eq!(image.pixel(200, 5), PAPER);
    }

    #[test]
    fn steps_of_colour_are_half_decades() {
        let steps = [0.0, 0.9e-8, 2e-8, 4e-8, 2e-7, 0.9e-3, 1.0, f64::INFINITY].map(colour);
        assert_eq!(steps.map(|step| step - FIRST), [0, 0, 0, 1, 2, 9, 9, 9]);
    }

    #[test]
    fn a_picture_can_be_read_again() {
        let image = Image { width: 3, height: 2, pixels: vec![0, 1, 2, 12, 3, 0] };
        let Picture::Png(bytes) = in_rows(&[image], 1).unwrap() else { panic!("not a PNG") };
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels[..9], [PALETTE[0], PALETTE[1], PALETTE[2]].concat());
        assert_eq!(pixels[9..18], [PALETTE[12], PALETTE[3], PALETTE[0]].concat());
    }
}
