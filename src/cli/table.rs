//! Tables for people.

/// A table; without rows it is empty. `head` names the columns, each with the side that its cells
/// keep to and its width: `scene<16|P(read)>7`. A row is its cells with tabs between them.
pub(super) fn table(head: &str, rows: impl IntoIterator<Item = String>) -> String {
    let column = |column| {
        let at = str::rfind(column, ['<', '>']).expect("a side for each column");
        let width: usize = column[at + 1..].parse().expect("a width for each column");
        (&column[..at], &column[at..=at] == ">", width)
    };
    let columns: Vec<(&str, bool, usize)> = head.split('|').map(column).collect();
    let line = |cells: String| {
        let cells = columns.iter().zip(cells.splitn(columns.len(), '\t'));
        let padded = cells.map(|((_, right, width), cell)| match right {
            true => format!("{cell:>width$}"),
            false => format!("{cell:width$}"),
        });
        padded.collect::<String>().trim_end().to_owned() + "\n"
    };
    let names = columns.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join("\t");
    let mut rows = rows.into_iter().map(line).peekable();
    let head = rows.peek().map(|_| line(names));
    head.into_iter().chain(rows).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_stand_under_their_heads() {
        let rows = ["team\t0.9\twell", "µ\t0.25\t", "a long one\t1\ta\tb"].map(str::to_owned);
        assert_eq!(
            table("scene<8|P>5|  note<0", rows),
            "scene       P  note\nteam      0.9well\nµ        0.25\na long one    1a\tb\n"
        );
        assert_eq!(table("scene<8", []), "");
    }
}
