//! Drawings as pixels.

use anyhow::{Result, anyhow};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};
use std::sync::Arc;

/// A PNG of an SVG, a pixel to each of its units. Text is set in DejaVu Sans, which comes with the program, so that the
/// picture is the same on every machine.
///
/// # Errors
/// A sentence where the SVG is not sound or has no size.
pub fn of_svg(svg: &str) -> Result<Vec<u8>> {
    let cannot = |error: &dyn std::fmt::Display| anyhow!("cannot draw the PNG: {error}");
    let mut options = Options { font_family: "DejaVu Sans".to_owned(), ..Options::default() };
    let fonts = Arc::make_mut(&mut options.fontdb);
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    let tree = Tree::from_str(svg, &options).map_err(|error| cannot(&error))?;
    let size = tree.size().to_int_size();
    let mut pixels =
        Pixmap::new(size.width(), size.height()).ok_or_else(|| cannot(&"the drawing has no size"))?;
    resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| cannot(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_shapes_become_pixels() {
        let svg = |inside: &str| {
            format!(r#"<svg width="40" height="30" xmlns="http://www.w3.org/2000/svg">{inside}</svg>"#)
        };
        let drawn = |inside: &str| {
            let pixels = Pixmap::decode_png(&of_svg(&svg(inside)).unwrap()).unwrap();
            assert_eq!((pixels.width(), pixels.height()), (40, 30));
            pixels.pixels().iter().filter(|pixel| pixel.alpha() > 0).count()
        };
        assert_eq!(drawn(""), 0);
        assert_eq!(drawn(r#"<rect x="10" y="10" width="4" height="3"/>"#), 12);
        let text = drawn(r#"<text x="2" y="20" font-family="sans-serif" font-size="16">dB</text>"#);
        assert!((60..400).contains(&text), "{text} pixels of text");
        assert!(of_svg("<svg").unwrap_err().to_string().starts_with("cannot draw the PNG: "));
    }
}
