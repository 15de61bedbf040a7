//! Just enough of Rust to tell code from comments and strings.

const TEST_ONLY: &str = "#[cfg(test)]";

/// A source in two views of the same length and the same lines; what a view leaves out is blank.
#[derive(Clone, Debug, Default)]
pub(super) struct Lexed {
    /// Without comments, and without what stands in strings.
    pub(super) code: String,
    /// Without comments, with strings.
    pub(super) spoken: String,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Code,
    Comment,
    Text,
}

impl Lexed {
    /// Reads a source.
    pub(super) fn of(text: &str) -> Self {
        let bytes = text.as_bytes();
        let (mut code, mut spoken) = (Vec::with_capacity(bytes.len()), Vec::with_capacity(bytes.len()));
        let mut at = 0;
        while at < bytes.len() {
            let (kind, length) = token(&bytes[at..], at.checked_sub(1).map(|before| bytes[before]));
            for &byte in &bytes[at..at + length] {
                let blank = if byte == b'\n' { byte } else { b' ' };
                code.push(if kind == Kind::Code { byte } else { blank });
                spoken.push(if kind == Kind::Comment { blank } else { byte });
            }
            at += length;
        }
        let view = |bytes| String::from_utf8(bytes).expect("whole characters are blanked");
        Self { code: view(code), spoken: view(spoken) }
    }

    /// Blanks every item that stands behind `#[cfg(test)]`.
    pub(super) fn without_tests(mut self) -> Self {
        while let Some(begin) = self.code.find(TEST_ONLY) {
            let end = end_of_item(self.code.as_bytes(), begin);
            for view in [&mut self.code, &mut self.spoken] {
                let blank: String =
                    view[begin..end].bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }).collect();
                view.replace_range(begin..end, &blank);
            }
        }
        self
    }

    /// The names of modules in files of their own that are there for tests only.
    pub(super) fn test_modules(&self) -> Vec<String> {
        let behind = self.code.match_indices(TEST_ONLY).map(|(at, _)| &self.code[at + TEST_ONLY.len()..]);
        behind
            .filter_map(|rest| {
                let rest = rest.trim_start().strip_prefix("mod ")?;
                let (name, _) = rest.split_once(';')?;
                name.chars().all(|c| c.is_alphanumeric() || c == '_').then(|| name.to_owned())
            })
            .collect()
    }
}

/// The kind and the length of what begins here; `before` is the byte before it.
fn token(bytes: &[u8], before: Option<u8>) -> (Kind, usize) {
    let in_word = before.is_some_and(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    match bytes {
        [b'/', b'/', ..] => (Kind::Comment, find(bytes, b"\n").unwrap_or(bytes.len())),
        [b'/', b'*', ..] => (Kind::Comment, block_comment(bytes)),
        [b'r' | b'b' | b'c', ..] if !in_word => {
            raw_string(bytes).map_or((Kind::Code, 1), |end| (Kind::Text, end))
        }
        [b'"', ..] => (Kind::Text, string(bytes)),
        [b'\'', b'\\', escaped @ ..] => {
            (Kind::Text, 3 + find(escaped.get(1..).unwrap_or(&[]), b"'").unwrap_or(0) + 1)
        }
        // A character that is not followed by a quote is a lifetime.
        [b'\'', rest @ ..] => match find(&rest[..rest.len().min(5)], b"'") {
            Some(end)
                if end > 0
                    && std::str::from_utf8(&rest[..end]).is_ok_and(|text| text.chars().count() == 1) =>
            {
                (Kind::Text, end + 2)
            }
            _ => (Kind::Code, 1),
        },
        _ => (Kind::Code, 1),
    }
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what)
}

fn block_comment(bytes: &[u8]) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < bytes.len() {
        match &bytes[at..] {
            [b'/', b'*', ..] => (depth, at) = (depth + 1, at + 2),
            [b'*', b'/', ..] => {
                (depth, at) = (depth - 1, at + 2);
                if depth == 0 {
                    return at;
                }
            }
            _ => at += 1,
        }
    }
    bytes.len()
}

fn string(bytes: &[u8]) -> usize {
    let mut at = 1;
    while at < bytes.len() {
        match bytes[at] {
            b'\\' => at += 2,
            b'"' => return at + 1,
            _ => at += 1,
        }
    }
    bytes.len()
}

/// The length of `r"…"`, `r#"…"#`, `b"…"`, `br"…"` and their like; `None` when this is another word.
fn raw_string(bytes: &[u8]) -> Option<usize> {
    let prefix = bytes.iter().take_while(|byte| b"rbc".contains(byte)).count();
    let hashes = bytes[prefix..].iter().take_while(|&&byte| byte == b'#').count();
    if bytes.get(prefix + hashes) != Some(&b'"') || prefix > 2 {
        return None;
    }
    if !bytes[..prefix].contains(&b'r') {
        return (hashes == 0).then(|| prefix + string(&bytes[prefix..]));
    }
    let close = [b"\"".as_slice(), &vec![b'#'; hashes]].concat();
    let inside = prefix + hashes + 1;
    Some(find(&bytes[inside..], &close).map_or(bytes.len(), |end| inside + end + close.len()))
}

/// Where the item behind the attribute at `begin` ends: at its semicolon, or at the brace that closes it.
fn end_of_item(code: &[u8], begin: usize) -> usize {
    let mut depth = 0_usize;
    for (at, &byte) in code.iter().enumerate().skip(begin) {
        match byte {
            b'{' => depth += 1,
            b'}' if depth <= 1 => return at + 1,
            b'}' => depth -= 1,
            b';' if depth == 0 => return at + 1,
            _ => {}
        }
    }
    code.len()
}

#[test]
fn comments_and_strings_are_told_from_code() {
    let source = r##"a /* b /* c */ d */ e // f
        "g \" h" 'i' '\'' '\n' r#"j " k"# 'l: loop {} r"m" for n 'é'"##;
    let Lexed { code, spoken } = Lexed::of(source);
    let words = |view: &str| view.split_whitespace().map(str::to_owned).collect::<Vec<_>>().join(" ");
    assert_eq!(words(&code), "a e 'l: loop {} for n");
    assert_eq!(words(&spoken), r##"a e "g \" h" 'i' '\'' '\n' r#"j " k"# 'l: loop {} r"m" for n 'é'"##);
    assert_eq!((code.len(), spoken.len()), (source.len(), source.len()));
}

#[test]
fn tests_are_blanked_to_their_closing_brace() {
    let source = "fn a() {}\n#[cfg(test)]\nmod tests { fn b() { \"}\" } }\nfn c() {}\n#[cfg(test)]\nmod d;\n";
    let lexed = Lexed::of(source);
    assert_eq!(lexed.test_modules(), ["d"]);
    let code = lexed.without_tests().code;
    assert_eq!(code.split_whitespace().collect::<String>(), "fna(){}fnc(){}");
    assert_eq!(code.lines().count(), source.lines().count());
}
