//! What the page offers: where it is, and how to point at it.

use crate::browser::Page;

/// Whether all lines that are offered lie within all plots.
pub fn is_in_view(page: &Page) {
    for (plot, [a, b]) in [("along", [0, 1]), ("across", [0, 2]), ("plan", [1, 2])] {
        let inside = page.ask(&format!(
            "viewshed.session.proposals.offered.every(({{ track }}) => track.points.every((p) => {{
               const v = viewshed.plots.{plot}.view;
               return p[{a}] >= v.left && p[{a}] <= v.right && p[{b}] >= v.bottom && p[{b}] <= v.top; }}))"
        ));
        assert_eq!(inside, true, "{plot}");
    }
}

/// Moves the mouse to where one of the lines that are offered is the nearest, zooming in where they lie close.
pub fn point_at(page: &Page, index: usize) {
    for zoom in [1.0, 4.0, 16.0] {
        let found = page.ask(&format!(
            "(() => {{
               const {{ session, plots: {{ along }} }} = viewshed;
               const wanted = session.proposals.offered[{index}];
               const points = wanted.track.points;
               const view = along.view;
               for (let k = 0; k + 1 < points.length; k += 1)
                 for (let f = 0; f <= 1; f += 0.05) {{
                   const place = [0, 1].map((i) => points[k][i] + f * (points[k + 1][i] - points[k][i]));
                   const [wide, high] = [(view.right - view.left) / {zoom}, (view.top - view.bottom) / {zoom}];
                   if ({zoom} > 1) viewshed.show('along', {{ left: place[0] - wide / 2, right: place[0] + wide / 2,
                     bottom: place[1] - high / 2, top: place[1] + high / 2 }});
                   along.cursor = place;
                   viewshed.pointAt(along);
                   if (session.pointed === wanted) return place;
                 }}
               viewshed.show('along', view);
               return null; }})()"
        ));
        if let [Some(time), Some(x)] = [0, 1].map(|k| found[k].as_f64()) {
            page.ask("(viewshed.session.pointed = null, 1)");
            page.hover(page.screen("along", time, x));
            page.until(&format!("viewshed.session.pointed === viewshed.session.proposals.offered[{index}]"));
            return;
        }
    }
    panic!("line {index} is nowhere the nearest");
}
