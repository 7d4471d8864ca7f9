//! Values drawn at random: a distribution may stand for any value of a scene.

use std::collections::BTreeMap;

use rand::{Rng, RngExt};
use toml::{Table, Value};

/// Keys of which a distribution has one.
const KINDS: [&str; 4] = ["uniform", "log_uniform", "choice", "of"];
/// Keys that change what was drawn, in this order: x -> times x + plus, rounded to a multiple.
const CHANGES: [&str; 3] = ["times", "plus", "multiple"];
/// Key of a table in a list: how often it is drawn.
const REPEAT: &str = "repeat";
/// Most tables of a list.
const MOST: f64 = 1000.0;

/// A wrong distribution: its dotted key and what is wrong with it.
pub(super) type Wrong = (String, String);

/// Draws the values of one scene. Named quantities are drawn where they are first used, and then stay.
pub(super) struct Draws<'a, R> {
    random: R,
    quantities: &'a Table,
    drawn: BTreeMap<String, Value>,
    /// Quantities being drawn, to notice those that refer to themselves.
    open: Vec<String>,
}

impl<'a, R: Rng> Draws<'a, R> {
    pub(super) fn new(random: R, quantities: &'a Table) -> Self {
        Self { random, quantities, drawn: BTreeMap::new(), open: Vec::new() }
    }

    /// `value` at the dotted key `at` with a drawn value in place of each distribution.
    pub(super) fn value(&mut self, value: &Value, at: &str) -> Result<Value, Wrong> {
        match value {
            Value::Table(table) if KINDS.iter().any(|kind| table.contains_key(*kind)) => {
                self.distribution(table, at)
            }
            Value::Table(table) => self.table(table, at).map(Value::Table),
            Value::Array(items) => self.list(items, at).map(Value::Array),
            other => Ok(other.clone()),
        }
    }

    /// A table of values at the dotted key `at`.
    pub(super) fn table(&mut self, table: &Table, at: &str) -> Result<Table, Wrong> {
        let draw = |(key, value): (&String, &Value)| {
            Ok((key.clone(), self.value(value, &format!("{at}.{key}"))?))
        };
        table.iter().map(draw).collect()
    }

    fn list(&mut self, items: &[Value], at: &str) -> Result<Vec<Value>, Wrong> {
        let mut drawn = Vec::new();
        for (index, item) in items.iter().enumerate() {
            let at = format!("{at}.{index}");
            match item.as_table().and_then(|table| Some((table, table.get(REPEAT)?))) {
                None => drawn.push(self.value(item, &at)?),
                Some((table, times)) => {
                    let times = self.repeats(times, &format!("{at}.{REPEAT}"))?;
                    let mut one = table.clone();
                    one.remove(REPEAT);
                    for _ in 0..times {
                        drawn.push(Value::Table(self.table(&one, &at)?));
                    }
                }
            }
        }
        Ok(drawn)
    }

    fn repeats(&mut self, times: &Value, at: &str) -> Result<usize, Wrong> {
        let times = self.number(times, at)?;
        if (0.0..=MOST).contains(&times) && times.fract() == 0.0 {
            Ok(times as usize)
        } else {
            Err((at.to_owned(), format!("is {times}; it is a whole number from 0 to {MOST}")))
        }
    }

    fn distribution(&mut self, table: &Table, at: &str) -> Result<Value, Wrong> {
        let wrong = |key: &str, reason: String| (format!("{at}.{key}"), reason);
        let kinds: Vec<&str> = KINDS.into_iter().filter(|kind| table.contains_key(*kind)).collect();
        let kind = kinds[0];
        let is_known = |key: &str| {
            key == kind || CHANGES.contains(&key) || (key == "weights" && kind == "choice")
        };
        if let Some(key) = table.keys().find(|key| !is_known(key)) {
            let reason = format!("is no key of a distribution with `{kind}`");
            return Err(wrong(key, reason));
        }
        let here = format!("{at}.{kind}");
        let drawn = match kind {
            "uniform" => {
                let [low, high] = self.range(&table[kind], &here)?;
                Value::Float(low + (high - low) * self.random.random::<f64>())
            }
            "log_uniform" => {
                let [low, high] = self.range(&table[kind], &here)?;
                if low <= 0.0 {
                    return Err((here, format!("begins at {low}; it is above 0")));
                }
                Value::Float(low * (high / low).powf(self.random.random::<f64>()))
            }
            "choice" => self.choice(table, at)?,
            _ => self.quantity(&table[kind], &here)?,
        };
        if !CHANGES.iter().any(|change| table.contains_key(*change)) {
            return Ok(drawn);
        }
        let mut x = self.number(&drawn, &here)?;
        if let Some(times) = table.get("times") {
            x *= self.number(times, &format!("{at}.times"))?;
        }
        if let Some(plus) = table.get("plus") {
            x += self.number(plus, &format!("{at}.plus"))?;
        }
        if let Some(multiple) = table.get("multiple") {
            let step = self.number(multiple, &format!("{at}.multiple"))?;
            if !(step > 0.0 && step.is_finite()) {
                return Err(wrong("multiple", format!("is {step}; it is above 0")));
            }
            x = (x / step).round() * step;
        }
        Ok(Value::Float(x))
    }

    /// One of the values of `choice`, all alike or by `weights`.
    fn choice(&mut self, table: &Table, at: &str) -> Result<Value, Wrong> {
        let here = format!("{at}.choice");
        let values = match &table["choice"] {
            Value::Array(values) if !values.is_empty() => values,
            _ => return Err((here, "is a list of values, such as [0.2, 0.5]".to_owned())),
        };
        let weights = match table.get("weights") {
            None => vec![1.0; values.len()],
            Some(weights) => weights_of(weights, values.len())
                .map_err(|reason| (format!("{at}.weights"), reason))?,
        };
        let mut left = weights.iter().sum::<f64>() * self.random.random::<f64>();
        let chosen = weights.iter().position(|weight| {
            left -= weight;
            left < 0.0
        });
        // Rounding may leave nothing: then it is the last that can be drawn.
        let last = || weights.iter().rposition(|weight| *weight > 0.0).unwrap_or(0);
        let index = chosen.unwrap_or_else(last);
        self.value(&values[index], &format!("{here}.{index}"))
    }

    /// The value of a named quantity.
    fn quantity(&mut self, name: &Value, at: &str) -> Result<Value, Wrong> {
        let known = || {
            let names: Vec<&str> = self.quantities.keys().map(String::as_str).collect();
            if names.is_empty() { "there is none".to_owned() } else { names.join(", ") }
        };
        let Some((name, value)) =
            name.as_str().and_then(|name| Some((name, self.quantities.get(name)?)))
        else {
            return Err((at.to_owned(), format!("is {name}, no quantity of `let`: {}", known())));
        };
        if let Some(drawn) = self.drawn.get(name) {
            return Ok(drawn.clone());
        }
        if self.open.iter().any(|open| open == name) {
            return Err((at.to_owned(), format!("refers to `{name}`, which depends on it")));
        }
        self.open.push(name.to_owned());
        let drawn = self.value(value, &format!("let.{name}"))?;
        self.open.pop();
        self.drawn.insert(name.to_owned(), drawn.clone());
        Ok(drawn)
    }

    fn range(&mut self, value: &Value, at: &str) -> Result<[f64; 2], Wrong> {
        let example = "is a list of two numbers, such as [0.2, 0.8]";
        let [low, high] = match value.as_array().map(Vec::as_slice) {
            Some([low, high]) => [self.number(low, at)?, self.number(high, at)?],
            _ => return Err((at.to_owned(), example.to_owned())),
        };
        if low <= high && low.is_finite() && high.is_finite() {
            Ok([low, high])
        } else {
            Err((at.to_owned(), format!("is from {low} to {high}, which does not rise")))
        }
    }

    fn number(&mut self, value: &Value, at: &str) -> Result<f64, Wrong> {
        match self.value(value, at)? {
            Value::Float(number) => Ok(number),
            Value::Integer(number) => Ok(number as f64),
            other => Err((at.to_owned(), format!("has {other} where a number is needed"))),
        }
    }
}

fn weights_of(value: &Value, count: usize) -> Result<Vec<f64>, String> {
    let number = |value: &Value| value.as_float().or(value.as_integer().map(|n| n as f64));
    let weights: Option<Vec<f64>> =
        value.as_array().and_then(|values| values.iter().map(number).collect());
    match weights {
        Some(weights)
            if weights.len() == count
                && weights.iter().all(|weight| *weight >= 0.0 && weight.is_finite())
                && weights.iter().sum::<f64>() > 0.0 =>
        {
            Ok(weights)
        }
        _ => Err(format!("is a list of {count} numbers, none below 0 and not all 0")),
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Draws of `x` from a text with `x` and `let`.
    fn draws(text: &str, count: u64) -> Result<Vec<Value>, Wrong> {
        let table: Table = toml::from_str(text).unwrap();
        let none = Table::new();
        let quantities = table.get("let").and_then(Value::as_table).unwrap_or(&none);
        let draw = |seed| {
            let random = ChaCha8Rng::seed_from_u64(seed);
            Draws::new(random, quantities).value(&table["x"], "x")
        };
        (0..count).map(draw).collect()
    }

    fn numbers(text: &str) -> Vec<f64> {
        draws(text, 4000).unwrap().iter().map(|value| value.as_float().unwrap()).collect()
    }

    fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = values.len() as f64;
        values.sum::<f64>() / count
    }

    /// A uniform variable on [a, b] has the mean (a + b) / 2 and the deviation (b - a) / sqrt(12); the mean of
    /// 4000 is within four standard errors, (b - a) / 55 in all.
    #[test]
    fn means_are_those_of_the_distributions() {
        let uniform = numbers("x = { uniform = [1.0, 3.0] }");
        assert!((mean(uniform.iter().copied()) - 2.0).abs() < 2.0 / 55.0);
        assert!(uniform.iter().all(|x| (1.0..3.0).contains(x)));
        // The logarithm of a log-uniform variable is uniform.
        let log = numbers("x = { log_uniform = [0.1, 10.0] }");
        assert!(mean(log.iter().map(|x| x.ln())).abs() < 100.0_f64.ln() / 55.0);
        // One in four; the standard error of the share is 0.0068.
        let choice = numbers("x = { choice = [0.5, { uniform = [1.0, 2.0] }], weights = [3, 1] }");
        let share = mean(choice.iter().map(|x| f64::from(*x > 0.75)));
        assert!((share - 0.25).abs() < 4.0 * 0.0068, "{share}");
    }

    #[test]
    fn quantities_are_drawn_once_for_a_scene() {
        let text = "x = [{ of = \"r\", times = 2 }, { of = \"r\" }, { of = \"h\", plus = -1.0 }]\n\
                    let.r = { log_uniform = [1.0, 4.0] }\nlet.h = { of = \"r\", plus = 1.0 }\n";
        for drawn in draws(text, 100).unwrap() {
            let x: Vec<f64> =
                drawn.as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect();
            assert!(x[0] == 2.0 * x[1] && (x[2] - x[1]).abs() < 1e-12, "{x:?}");
        }
        let rounded = numbers("x = { uniform = [0.1, 0.9], multiple = 0.0625 }");
        assert!(rounded.iter().all(|x| (x / 0.0625).fract() == 0.0));
    }

    #[test]
    fn tables_are_repeated() {
        let text = "x = [{ repeat = { choice = [0, 1, 2] }, corner = { uniform = [0, 1] } }, 7]";
        let found = draws(text, 300).unwrap();
        let lists: Vec<&Vec<Value>> = found.iter().map(|v| v.as_array().unwrap()).collect();
        for count in 1..=3 {
            assert!(lists.iter().any(|list| list.len() == count), "{count}");
        }
        let long = lists.iter().find(|list| list.len() == 3).unwrap();
        assert!(long[0]["corner"] != long[1]["corner"] && long[0].get("repeat").is_none());
    }

    #[test]
    fn wrong_distributions_are_named() {
        for (text, key, reason) in [
            ("x = { uniform = [2, 1] }", "x.uniform", "does not rise"),
            ("x = { uniform = 1 }", "x.uniform", "two numbers"),
            ("x = { log_uniform = [0, 1] }", "x.log_uniform", "above 0"),
            ("x = { choice = [] }", "x.choice", "list of values"),
            ("x = { choice = [1, 2], weights = [1] }", "x.weights", "2 numbers"),
            ("x = { choice = [1, 2], weights = [0, 0] }", "x.weights", "not all 0"),
            ("x = { of = \"h\" }\nlet.r = 1", "x.of", "quantity of `let`: r"),
            ("x = { of = \"r\" }\nlet.r = { of = \"r\" }", "let.r.of", "depends on it"),
            ("x = { uniform = [0, 1], weight = 3 }", "x.weight", "`uniform`"),
            ("x = { uniform = [0, 1], multiple = 0 }", "x.multiple", "above 0"),
            ("x = { choice = [\"a\"], times = 2 }", "x.choice", "number"),
            ("x = [{ repeat = 1.5, y = 1 }]", "x.0.repeat", "whole number"),
        ] {
            let (found, said) = draws(text, 1).unwrap_err();
            assert!(found == key && said.contains(reason), "{text}: {found}: {said}");
        }
    }
}
