//! Generates the types of answers in TypeScript for the page and in Python for the package from the
//! Rust declarations and their serde attributes.

use std::collections::{BTreeMap, BTreeSet};

use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::{
    Attribute, Expr, Field, Fields, GenericArgument, Ident, Item, ItemEnum, Lit, PathArguments,
    Token, Type,
};

/// Rust files that contain the declarations.
const FILES: [&str; 14] = [
    "core/diagnostic.rs",
    "score/calibration.rs",
    "score/causes.rs",
    "score/verdict.rs",
    "serve/entries.rs",
    "serve/entries/flown.rs",
    "serve/gallery.rs",
    "studies/outcome.rs",
    "studies/statistics.rs",
    "studies/tune.rs",
    "photo_service/about.rs",
    "photo_service/answer.rs",
    "photo_service/messages.rs",
    "photo_service/replay.rs",
];

/// Generated file, its head, and the root types whose members are generated with them.
const PAGE: (&str, &str, &[&str]) = (
    "src/serve/page/answers.d.ts",
    "// What the server answers: made by tests/it/answer_types.rs of the types in Rust. Read by tsc alone.\n",
    &["LiveFacts", "LargeFacts", "Asked", "About", "Queue", "ForVisitor", "Wall"],
);
const PACKAGE: (&str, &str, &[&str]) = (
    "examples/python/src/noctograph/answers.py",
    "\"\"\"What stages find, as dictionaries: made by tests/it/answer_types.rs of the types in Rust.\"\"\"\n\n\
     from __future__ import annotations\n\nfrom typing import Any, Literal, TypedDict\n",
    &["Verdict", "Outcome", "Candidate"],
);

/// Types that macros declare, and tables of the scene file, with their spellings in both languages.
const FROM_ELSEWHERE: [(&str, [&str; 2]); 4] = [
    ("Deck", ["string", "str"]),
    ("Scene", ["Record<string, any>", "dict[str, Any]"]),
    ("ControllerOptions", ["Record<string, any>", "dict[str, Any]"]),
    ("Value", ["any", "Any"]),
];

/// Language of a generated file, used as the index in pairs of spellings.
#[derive(Clone, Copy, PartialEq)]
enum Language {
    TypeScript,
    Python,
}

/// Serde attributes of a type, of a member or of a variant.
#[derive(Default)]
struct Told {
    rename: Option<String>,
    rename_all: Option<String>,
    is_flat: bool,
    is_optional: bool,
    is_skipped: bool,
}

impl Told {
    fn new(attributes: &[Attribute]) -> Self {
        let mut told = Self::default();
        for attribute in attributes.iter().filter(|it| it.path().is_ident("serde")) {
            let read = attribute.parse_nested_meta(|meta| {
                let value = || Ok::<_, syn::Error>(meta.value()?.parse::<syn::LitStr>()?.value());
                match &*meta.path.get_ident().map(Ident::to_string).unwrap_or_default() {
                    "rename" => told.rename = Some(value()?),
                    "rename_all" => told.rename_all = Some(value()?),
                    "flatten" => told.is_flat = true,
                    "skip" => told.is_skipped = true,
                    "skip_serializing_if" => told.is_optional = !value()?.is_empty(),
                    // These attributes concern only deserialization.
                    "default" | "deny_unknown_fields" | "skip_deserializing" => {}
                    _ => return Err(meta.error("unknown to tests/it/answer_types.rs")),
                }
                Ok(())
            });
            read.unwrap();
        }
        told
    }

    /// Returns the name of a variant in JSON.
    fn cased(&self, variant: &Ident) -> String {
        let between = match self.rename_all.as_deref() {
            None => return variant.to_string(),
            Some("kebab-case") => "-",
            Some("snake_case") => "_",
            Some(other) => panic!("{other} is unknown to tests/it/answer_types.rs"),
        };
        let mut name = String::new();
        for (index, letter) in variant.to_string().char_indices() {
            name += if index > 0 && letter.is_uppercase() { between } else { "" };
            name.extend(letter.to_lowercase());
        }
        name
    }
}

/// Returns the first paragraph of a doc comment, without the markup of links.
fn doc(attributes: &[Attribute]) -> String {
    let line = |attribute: &Attribute| match &attribute.meta.require_name_value().ok()?.value {
        Expr::Lit(it) => match &it.lit {
            Lit::Str(text) => Some(text.value().trim().to_owned()),
            _ => None,
        },
        _ => None,
    };
    let docs = attributes.iter().filter(|it| it.path().is_ident("doc"));
    let lines = docs.filter_map(line).take_while(|line| !line.is_empty());
    let text = lines.collect::<Vec<_>>().join(" ").replace("[`", "`").replace("`]", "`");
    // A Rust path is shortened to its last segment.
    let words = text.split(' ').map(|word| match word.rsplit_once("::") {
        Some((path, name)) if path.starts_with('`') => format!("`{name}"),
        _ => word.to_owned(),
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Formats a doc comment in TypeScript.
fn remark(indent: &str, doc: &str) -> String {
    match doc.replace("`None`", "null") {
        none if none.is_empty() => none,
        doc => format!("{indent}/** {doc} */\n"),
    }
}

/// Documented names in `figures!`, which are the members of `Flown`.
struct Figures(Vec<Field>);

impl Parse for Figures {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        let figure = |input: ParseStream<'_>| {
            let (attributes, name) = (input.call(Attribute::parse_outer)?, input.parse::<Ident>()?);
            let field: syn::FieldsNamed = syn::parse_quote!({ #(#attributes)* pub #name: f64 });
            Ok(field.named[0].clone())
        };
        let figures = Punctuated::<Field, Token![,]>::parse_terminated_with(input, figure)?;
        Ok(Self(figures.into_iter().collect()))
    }
}

/// Declaration of a type in Rust.
enum Declared {
    Members(Vec<Attribute>, Vec<Field>),
    Names(ItemEnum),
    Alias(Type),
}

fn declared() -> BTreeMap<String, Declared> {
    let mut types = BTreeMap::new();
    for file in FILES {
        let path = format!("{}/src/{file}", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
        for item in syn::parse_file(&text).unwrap().items {
            let (name, of_name) = match item {
                Item::Struct(it) => {
                    let fields = it.fields.into_iter().filter(|field| field.ident.is_some());
                    (it.ident, Declared::Members(it.attrs, fields.collect()))
                }
                Item::Enum(it) => (it.ident.clone(), Declared::Names(it)),
                Item::Type(it) => (it.ident, Declared::Alias(*it.ty)),
                Item::Macro(it) if it.mac.path.is_ident("figures") => {
                    let Figures(fields) = it.mac.parse_body().unwrap();
                    let attribute = syn::parse_quote!(#[doc = "Figures of a flight."]);
                    let name = syn::parse_quote!(Flown);
                    (name, Declared::Members(vec![attribute], fields))
                }
                _ => continue,
            };
            types.insert(name.to_string(), of_name);
        }
    }
    types
}

/// Text of a generated file, and the names of types that are still to be written.
struct Writer<'a> {
    types: &'a BTreeMap<String, Declared>,
    language: Language,
    needed: BTreeSet<String>,
    /// Types whose members are flattened into another type and may all be missing.
    partial: BTreeSet<String>,
}

impl Writer<'_> {
    fn pick<'b>(&self, spellings: [&'b str; 2]) -> &'b str {
        spellings[self.language as usize]
    }

    /// Returns the spelling of a type in the language.
    fn spelled(&mut self, kind: &Type) -> String {
        let path = match kind {
            Type::Reference(it) => return self.spelled(&it.elem),
            Type::Array(it) => {
                let Expr::Lit(syn::ExprLit { lit: Lit::Int(n), .. }) = &it.len else {
                    panic!("an array of unknown length")
                };
                let (item, n) = (self.spelled(&it.elem), n.base10_parse().unwrap());
                return match self.language {
                    Language::TypeScript => format!("[{}]", vec![item; n].join(", ")),
                    Language::Python => format!("list[{item}]"),
                };
            }
            Type::Path(it) => it.path.segments.last().unwrap(),
            _ => panic!("a type of unknown kind"),
        };
        let mut within = Vec::new();
        if let PathArguments::AngleBracketed(arguments) = &path.arguments {
            for argument in &arguments.args {
                if let GenericArgument::Type(kind) = argument {
                    within.push(self.spelled(kind));
                }
            }
        }
        let name = path.ident.to_string();
        match (&*name, &*within) {
            ("Option", [item]) => format!("{item} | {}", self.pick(["null", "None"])),
            ("Vec", [item]) if self.language == Language::Python => format!("list[{item}]"),
            ("Vec", [item]) if item.contains(' ') => format!("({item})[]"),
            ("Vec", [item]) => format!("{item}[]"),
            ("Box", [item]) => item.clone(),
            ("BTreeMap", [_, item]) => match self.language {
                Language::TypeScript => format!("Record<string, {item}>"),
                Language::Python => format!("dict[str, {item}]"),
            },
            ("f64", []) => self.pick(["number", "float"]).to_owned(),
            ("u8" | "u32" | "u64" | "usize" | "i64", []) => self.pick(["number", "int"]).to_owned(),
            ("bool", []) => self.pick(["boolean", "bool"]).to_owned(),
            ("String" | "str" | "char", []) => self.pick(["string", "str"]).to_owned(),
            _ => match FROM_ELSEWHERE.iter().find(|(known, _)| *known == name) {
                Some((_, spellings)) => self.pick(*spellings).to_owned(),
                None => self.named(name),
            },
        }
    }

    fn named(&mut self, name: String) -> String {
        match self.types.get(&name) {
            Some(Declared::Alias(kind)) => self.spelled(kind),
            Some(_) => {
                self.needed.insert(name.clone());
                name
            }
            None => panic!("{name} is declared in none of FILES"),
        }
    }

    /// Returns the declaration of a type in the language.
    fn declaration(&mut self, name: &str) -> String {
        match &self.types[name] {
            Declared::Members(attributes, fields) => self.members(name, attributes, fields),
            Declared::Names(it) => {
                let told = Told::new(&it.attrs);
                let name_of = |variant: &syn::Variant| match variant.fields {
                    Fields::Unit => format!("\"{}\"", told.cased(&variant.ident)),
                    _ => panic!("{name} has more than names"),
                };
                let names: Vec<String> = it.variants.iter().map(name_of).collect();
                match self.language {
                    Language::TypeScript => {
                        format!(
                            "{}type {name} = {};\n",
                            remark("", &doc(&it.attrs)),
                            names.join(" | ")
                        )
                    }
                    Language::Python => format!(
                        "{name} = Literal[\n    {},\n]\n\"\"\"{}\"\"\"\n",
                        names.join(",\n    "),
                        doc(&it.attrs)
                    ),
                }
            }
            Declared::Alias(_) => unreachable!("it is spelled where it is used"),
        }
    }

    fn members(&mut self, name: &str, attributes: &[Attribute], fields: &[Field]) -> String {
        let (mut bases, mut lines) = (Vec::new(), String::new());
        for field in fields {
            let (told, doc) = (Told::new(&field.attrs), doc(&field.attrs));
            let kind = self.spelled(&field.ty);
            let whole = kind.strip_suffix(self.pick([" | null", " | None"]));
            let key = told.rename.or(field.ident.as_ref().map(Ident::to_string)).unwrap();
            match self.language {
                _ if told.is_skipped => {}
                Language::TypeScript if told.is_flat => {
                    bases.push(whole.map_or(kind.clone(), |whole| format!("Partial<{whole}>")));
                }
                Language::Python if told.is_flat => {
                    self.partial.extend(whole.map(str::to_owned));
                    bases.push(whole.unwrap_or(&kind).to_owned());
                }
                Language::TypeScript => {
                    lines += &remark("  ", &doc);
                    let key = if key.contains('-') { format!("\"{key}\"") } else { key };
                    // A member that may be omitted is never null.
                    let (key, kind) = match told.is_optional {
                        true => (key + "?", whole.unwrap_or(&kind)),
                        false => (key, &*kind),
                    };
                    lines += &format!("  {key}: {kind};\n");
                }
                Language::Python => {
                    assert!(!told.is_optional, "{name}.{key}: Python 3.10 has no NotRequired");
                    lines += &format!("    {key}: {kind}\n    \"\"\"{doc}\"\"\"\n");
                }
            }
        }
        let doc = doc(attributes);
        match self.language {
            Language::TypeScript => {
                let bases = match bases.join(", ") {
                    none if none.is_empty() => none,
                    bases => format!(" extends {bases}"),
                };
                format!("{}interface {name}{bases} {{\n{lines}}}\n", remark("", &doc))
            }
            Language::Python => {
                bases.push("TypedDict".to_owned());
                bases.extend(self.partial.contains(name).then(|| "total=False".to_owned()));
                let bases = bases.join(", ");
                format!("class {name}({bases}):\n    \"\"\"{doc}\"\"\"\n\n{lines}")
            }
        }
    }
}

/// Returns the generated file of a language.
fn written(language: Language, (_, head, roots): (&str, &str, &[&str])) -> String {
    let needed = roots.iter().map(|root| (*root).to_owned()).collect();
    let (types, partial) = (declared(), BTreeSet::new());
    let mut writer = Writer { types: &types, language, needed, partial };
    let mut done = BTreeMap::new();
    while let Some(name) = writer.needed.iter().find(|it| !done.contains_key(*it)).cloned() {
        let declaration = writer.declaration(&name);
        done.insert(name, declaration);
    }
    let between = if language == Language::Python { "\n\n" } else { "\n" };
    done.into_values().fold(head.to_owned(), |text, declaration| text + between + &declaration)
}

#[test]
fn page_and_package_have_the_types_of_answers() {
    for (language, file) in [(Language::TypeScript, PAGE), (Language::Python, PACKAGE)] {
        let (path, text) =
            (format!("{}/{}", env!("CARGO_MANIFEST_DIR"), file.0), written(language, file));
        if crate::bless::is_blessed(&path) {
            std::fs::write(&path, &text).unwrap();
        }
        let known = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            known == text,
            "{path} is not of the types in Rust: NOCTOGRAPH_BLESS=1 writes it anew"
        );
    }
}
