//! How usual the letters of a word follow one another: viewers complete a usual word from half of its
//! light, and need every letter of an unusual one.

use std::sync::LazyLock;

use super::alphabet::{class_of, latin};

/// Letters of the Latin alphabet, and the begin or end of a word.
const N_SYMBOLS: usize = 27;

/// −100 ln p of one symbol after another, by the first and then the second; 0 is the begin or end of a
/// word. From English words and names, by `examples/readings/pairs.py`.
static COSTS: LazyLock<Vec<u16>> = LazyLock::new(|| {
    let costs = include_str!("pairs.txt").split_whitespace();
    costs.map(|cost| cost.parse().expect("the table holds numbers")).collect()
});

/// The same of a pair with a digit, as of one character of 36.
const WITH_DIGIT: u16 = 358;

/// The mean over the words of the readings, which a single character gets: it has no neighbors.
const AVERAGE: u16 = 313;

/// Mean of ln p over the pairs of a text's words, begins and ends included; of letters without their
/// marks, cases aside.
pub(super) fn mean_ln_p(text: &str) -> f64 {
    let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let costs = words.flat_map(|word| {
        let symbols: Vec<_> = format!(" {word} ").chars().map(symbol).collect();
        let costs = symbols.windows(2).map(|pair| cost(pair[0], pair[1]));
        if symbols.len() > 3 { costs.collect() } else { vec![AVERAGE] }
    });
    let (sum, n) = costs.fold((0, 0), |(sum, n), cost| (sum + u64::from(cost), n + 1));
    -0.01 * sum as f64 / f64::from(n.max(1))
}

/// The net's classes of capitals are 1 to 26.
fn symbol(character: char) -> Option<usize> {
    if character == ' ' {
        return Some(0);
    }
    class_of(latin(character)?.to_ascii_uppercase()).filter(|class| *class < N_SYMBOLS)
}

fn cost(first: Option<usize>, second: Option<usize>) -> u16 {
    let (Some(first), Some(second)) = (first, second) else { return WITH_DIGIT };
    COSTS[N_SYMBOLS * first + second]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_row_of_the_table_is_a_distribution() {
        assert_eq!(COSTS.len(), N_SYMBOLS * N_SYMBOLS);
        for row in COSTS.chunks(N_SYMBOLS) {
            let sum: f64 = row.iter().map(|cost| libm::exp(-0.01 * f64::from(*cost))).sum();
            assert!((sum - 1.0).abs() < 0.02, "{sum}");
        }
    }

    #[test]
    fn words_are_more_usual_than_letters_at_random() {
        let usual = mean_ln_p("HOUSE");
        assert!(usual > mean_ln_p("XKQJW") + 1.5);
        assert!(usual > mean_ln_p("4711") && mean_ln_p("4711") > mean_ln_p("XKQJW"));
        assert_eq!(mean_ln_p("Zoë"), mean_ln_p("ZOE"));
        let [both, first, second] = ["on air!", "on", "air"].map(mean_ln_p);
        assert!((both - (3.0 * first + 4.0 * second) / 7.0).abs() < 1e-12, "{both}");
        assert_eq!(mean_ln_p("C"), mean_ln_p("7"));
    }
}
