//! What a page has to look like, whatever it shows.

use std::path::{Path, PathBuf};

use crate::browser::Page;

/// Where the README's pictures go: the folder in `VIEWSHED_PICTURES`, to renew them, or the one for all others.
pub fn readme(others: &Path) -> PathBuf {
    std::env::var_os("VIEWSHED_PICTURES").map_or_else(|| others.to_owned(), PathBuf::from)
}

/// Nothing is cut off or hidden to the right, and no text is smaller than it may be.
pub fn is_readable(page: &Page, width: u32) {
    let wide = page.number("document.documentElement.scrollWidth");
    assert!(wide <= f64::from(width), "{wide} px of {width}");
    let small = page.ask(
        "[...document.querySelectorAll('body *')].filter((e) => e.checkVisibility() && e.childNodes.length &&
          parseFloat(getComputedStyle(e).fontSize) < 11).map((e) => e.outerHTML.slice(0, 80))",
    );
    assert_eq!(small.as_array().unwrap().len(), 0, "{small}");
}

/// Contrast of text with the page, after WCAG 2.
pub fn contrast(page: &Page, selector: &str) -> f64 {
    page.number(&format!(
        "(() => {{
           const luminance = (colour) => {{
             const [r, g, b] = colour.match(/[\\d.]+/g).slice(0, 3).map((v) => v / 255)
               .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
             return 0.2126 * r + 0.7152 * g + 0.0722 * b;
           }};
           const element = document.querySelector('{selector}');
           const clear = 'rgba(0, 0, 0, 0)';
           let behind = element;
           while (getComputedStyle(behind).backgroundColor === clear && behind.parentElement) behind = behind.parentElement;
           const both = [getComputedStyle(element).color, getComputedStyle(behind).backgroundColor].map(luminance);
           return (Math.max(...both) + 0.05) / (Math.min(...both) + 0.05);
         }})()"
    ))
}
