//! A table of words, for a terminal, in Markdown, or in HTML.

/// Rows of words under a head; the first column is left-aligned, the others right.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    /// Names of the columns.
    pub head: Vec<String>,
    /// The rows, each as long as the head.
    pub rows: Vec<Vec<String>>,
}

impl Grid {
    /// Markdown, padded so that it is readable as it stands: what a terminal gets too.
    #[must_use]
    pub fn markdown(&self) -> String {
        let length = |cell: &String| cell.chars().count();
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.chain(self.head.get(column)).map(length).max().unwrap_or(0).max(3)
        };
        let widths: Vec<_> = (0..self.head.len()).map(width).collect();
        let line = |row: &[String]| {
            let cells = row.iter().zip(&widths).enumerate().map(|(place, (cell, width))| {
                let cell = cell.replace('|', "\\|");
                if place == 0 { format!(" {cell:width$} ") } else { format!(" {cell:>width$} ") }
            });
            format!("|{}|\n", cells.collect::<Vec<_>>().join("|"))
        };
        let rule = widths.iter().enumerate().map(|(place, width)| {
            let dashes = "-".repeat(width + 1);
            if place == 0 { format!("{dashes}-") } else { format!("{dashes}:") }
        });
        let rule = format!("|{}|\n", rule.collect::<Vec<_>>().join("|"));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}{rule}{rows}", line(&self.head))
    }

    /// An HTML table.
    #[must_use]
    pub fn html(&self) -> String {
        let row = |tag: &str, row: &[String]| {
            let cells: String = row.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
            format!("<tr>{cells}</tr>\n")
        };
        let rows: String = self.rows.iter().map(|cells| row("td", cells)).collect();
        format!("<table>\n{}{rows}</table>\n", row("th", &self.head))
    }
}

/// Text as HTML shows it.
#[must_use]
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_markdown_and_html() {
        let word = |text: &str| text.to_owned();
        let grid = Grid { head: vec![word("figure"), word("run")], rows: vec![vec![word("a"), word("<5>")]] };
        assert_eq!(grid.markdown(), "| figure | run |\n|--------|----:|\n| a      | <5> |\n");
        assert!(grid.html().contains("<td>&lt;5&gt;</td>"));
    }
}
