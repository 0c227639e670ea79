import pathlib
p=pathlib.Path('PROJECT/.rs'); s=p.read_text()
s=s.replace('''        let readability = readability(&choices, against, self.ln_p_of_pairs);
''','''        let readability = readability(&choices, against, self.ln_p_of_pairs);
        #[expect(clippy::print_stdout)]
        {
        let n = self.characters.len();
        let same = self.odds(columns, &choices).into_iter().filter(|o| o.word.chars().count() == n).map(|o| o.ln_odds).fold(f64::NEG_INFINITY, f64::max);
        let other = self.odds(columns, &choices).into_iter().filter(|o| o.word.chars().count() != n).map(|o| (o.ln_odds, o.word)).fold((f64::NEG_INFINITY, String::new()), |a,b| if b.0>a.0 {b} else {a});
        let ln: Vec<String> = choices.iter().map(|c| format!("{:.5}", libm::log(c.p.max(1e-9)))).collect();
        println!("VIEW\\t{}\\t{:.4}\\t{:.3}\\t{:.3}\\t{}\\t{}\\t{:.4}", self.characters.iter().collect::<String>(), readability, same, other.0, other.1, ln.join(","), self.ln_p_of_pairs);
        }
''')
s=s.replace('''    fn rival(&self, columns: &Columns, choices: &[Choice]) -> Option<Odds> {
''','''    fn rival(&self, columns: &Columns, choices: &[Choice]) -> Option<Odds> {
        self.odds(columns, choices).into_iter().reduce(|a, b| if b.ln_odds > a.ln_odds { b } else { a })
    }
    fn odds(&self, columns: &Columns, choices: &[Choice]) -> Vec<Odds> {
''')
s=s.replace('''        all.reduce(|a, b| if b.ln_odds > a.ln_odds { b } else { a })
''','''        all.collect()
''')
p.write_text(s)
