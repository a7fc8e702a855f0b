//! A field as a key.

use crate::docs::first_paragraph;
use proc_macro2::TokenStream;
use quote::quote;
use syn::spanned::Spanned as _;
use syn::{
    Error, Expr, ExprLit, ExprRange, Field, GenericArgument, Lit, LitStr, PathArguments,
    RangeLimits, Result, Type,
};

/// What `#[key(...)]` says.
#[derive(Default)]
struct Said {
    name: Option<String>,
    role: Role,
    default: Option<Absent>,
    range: Option<Expr>,
    above: Option<Expr>,
    most: Option<Expr>,
    length: Option<Expr>,
    table: Option<Expr>,
    tables: Option<Expr>,
    kind: Option<Expr>,
    field: Option<Expr>,
    doc: Option<Expr>,
}

/// What a field is to its section.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Role {
    /// A key that the section describes.
    #[default]
    Key,
    /// The key that selects a variant.
    Tag,
    /// A section whose keys are among those of this one.
    Flattened,
    /// A key that the table around the variant describes.
    Inherited,
    /// No key.
    Skipped,
}

/// What a key is when absent.
enum Absent {
    Required,
    Nothing,
    Table,
    Value(Box<Expr>),
}

/// A field, as a key.
pub(crate) struct Key<'a> {
    pub(crate) name: String,
    doc: String,
    pub(crate) field: &'a Field,
    said: Said,
}

impl<'a> Key<'a> {
    pub(crate) fn of(field: &'a Field) -> Result<Self> {
        let mut said = Said::default();
        for attribute in field.attrs.iter().filter(|own| own.path().is_ident("key")) {
            attribute.parse_nested_meta(|meta| {
                let path = meta.path.clone();
                let is = |name: &str| path.is_ident(name);
                if is("default") {
                    said.default = Some(match meta.value() {
                        Ok(value) => Absent::Value(Box::new(value.parse()?)),
                        Err(_) => Absent::Table,
                    });
                } else if is("required") {
                    said.default = Some(Absent::Required);
                } else if is("absent") {
                    said.default = Some(Absent::Nothing);
                } else if is("tag") {
                    said.role = Role::Tag;
                } else if is("flatten") {
                    said.role = Role::Flattened;
                } else if is("inherited") {
                    said.role = Role::Inherited;
                } else if is("skip") {
                    said.role = Role::Skipped;
                } else if is("name") {
                    said.name = Some(meta.value()?.parse::<LitStr>()?.value());
                } else {
                    let place = match path.get_ident().map(ToString::to_string).as_deref() {
                        Some("range") => &mut said.range,
                        Some("above") => &mut said.above,
                        Some("most") => &mut said.most,
                        Some("length") => &mut said.length,
                        Some("table") => &mut said.table,
                        Some("tables") => &mut said.tables,
                        Some("kind") => &mut said.kind,
                        Some("field") => &mut said.field,
                        Some("doc") => &mut said.doc,
                        _ => return Err(meta.error("not known: see the documentation of Section")),
                    };
                    *place = Some(meta.value()?.parse()?);
                }
                Ok(())
            })?;
        }
        let ident = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
        let name = said.name.clone().unwrap_or_else(|| ident.trim_start_matches("r#").to_owned());
        Ok(Self { name, doc: first_paragraph(&field.attrs), field, said })
    }

    /// What the field is to its section.
    pub(crate) fn role(&self) -> Role {
        self.said.role
    }

    /// The type of its value, where it is there.
    pub(crate) fn ty(&self) -> &Type {
        within("Option", &self.field.ty).unwrap_or(&self.field.ty)
    }

    /// Whether the field may be without a value.
    pub(crate) fn is_optional(&self) -> bool {
        within("Option", &self.field.ty).is_some()
    }

    /// The name of the variant that a tag selects by default.
    pub(crate) fn default_variant(&self) -> TokenStream {
        match &self.said.default {
            Some(Absent::Value(name)) => quote!(::std::option::Option::Some(#name)),
            _ => quote!(::std::option::Option::None),
        }
    }

    /// Least and greatest value, if they are said.
    pub(crate) fn limits(&self) -> Option<&Expr> {
        self.said.range.as_ref()
    }

    /// What the compiler checks: that a description from elsewhere is one of this key, and that the default of a tag
    /// or of a choice is one of its alternatives.
    pub(crate) fn assertion(&self) -> Option<TokenStream> {
        let name = &self.name;
        let holds = match (&self.said.field, &self.said.default, self.said.role) {
            (Some(field), ..) => quote!(::proto::config::is_same_text(#field.key, #name)),
            (None, Some(Absent::Value(default)), Role::Tag) => {
                let ty = self.ty();
                let variants = quote!(<#ty as ::proto::config::Alternatives>::VARIANTS);
                quote!(::proto::config::has_variant(#variants, #default))
            }
            (None, Some(Absent::Value(default)), Role::Key) if is_text(default) => {
                let ty = self.ty();
                quote!(::proto::config::may_be(&<#ty as ::proto::config::Key>::KIND, #default))
            }
            _ => return None,
        };
        Some(quote!(
            const _: () = assert!(#holds);
        ))
    }

    /// `Field { ... }`.
    pub(crate) fn description(&self) -> Result<TokenStream> {
        if let Some(field) = &self.said.field {
            return Ok(quote!(#field));
        }
        let (name, doc) = (&self.name, self.doc());
        let kind = self.kind()?;
        let default = self.default();
        Ok(quote! {
            ::proto::config::Field { key: #name, doc: #doc, kind: #kind, default: #default }
        })
    }

    /// What the key means.
    pub(crate) fn doc(&self) -> TokenStream {
        let doc = &self.doc;
        self.said.doc.as_ref().map_or_else(|| quote!(#doc), |said| quote!(#said))
    }

    /// What the key may be.
    pub(crate) fn kind(&self) -> Result<TokenStream> {
        let said = &self.said;
        if let Some(kind) = &said.kind {
            return Ok(quote!(#kind));
        }
        if let Some(spec) = &said.table {
            return Ok(quote!(::proto::config::Kind::Table(&#spec)));
        }
        if let Some(spec) = &said.tables {
            return Ok(quote!(::proto::config::Kind::Tables(&#spec)));
        }
        self.kind_of(self.ty())
    }

    fn kind_of(&self, ty: &Type) -> Result<TokenStream> {
        if let Some(entry) = within("Vec", ty) {
            let Some(length) = &self.said.length else {
                return Ok(if self.has_range() {
                    let of = self.kind_of(entry)?;
                    quote!(::proto::config::Kind::List { of: &#of, min: 0, max: usize::MAX })
                } else {
                    quote!(<#entry as ::proto::config::Key>::LIST)
                });
            };
            let of = self.kind_of(entry)?;
            let (min, max) = ends(length, &quote!(usize::MAX))?;
            return Ok(quote!(::proto::config::Kind::List { of: &#of, min: #min, max: #max }));
        }
        if let Type::Array(array) = ty {
            let (of, n) = (self.kind_of(&array.elem)?, &array.len);
            return Ok(quote!(::proto::config::Kind::List { of: &#of, min: #n, max: #n }));
        }
        let is_number = matches!(name_of(ty).as_deref(), Some("f64" | "f32"));
        if is_number && self.has_range() {
            let range = self.range()?;
            return Ok(quote!(::proto::config::Kind::Number(#range)));
        }
        match &self.said.range {
            Some(range) if name_of(ty).is_some_and(|name| INTEGERS.contains(&&*name)) => {
                let greatest = quote!(::proto::config::greatest(<#ty>::MAX as u128));
                let (min, max) = ends(range, &greatest)?;
                Ok(
                    quote!(::proto::config::Kind::Integer { min: (#min) as i64, max: (#max) as i64 }),
                )
            }
            _ => Ok(quote!(<#ty as ::proto::config::Key>::KIND)),
        }
    }

    fn has_range(&self) -> bool {
        self.said.range.is_some() || self.said.above.is_some()
    }

    /// The range of a number.
    fn range(&self) -> Result<TokenStream> {
        let infinity = quote!(f64::INFINITY);
        if let Some(above) = &self.said.above {
            let most = self.said.most.as_ref().map_or(infinity, |most| quote!(#most));
            return Ok(quote!(::proto::config::Range::above(#above, #most)));
        }
        match &self.said.range {
            Some(range @ Expr::Range(_)) => {
                let (min, max) = ends(range, &infinity)?;
                Ok(quote!(::proto::config::Range::closed(#min, #max)))
            }
            range => Ok(quote!(#range)),
        }
    }

    fn default(&self) -> TokenStream {
        let kind = quote!(::proto::config::Default);
        match &self.said.default {
            Some(Absent::Required) if self.is_optional() => quote!(#kind::RequiredOrNone),
            Some(Absent::Required) => quote!(#kind::Required),
            Some(Absent::Nothing) => quote!(#kind::Absent),
            Some(Absent::Table) => quote!(#kind::Table),
            Some(Absent::Value(value)) => match (name_of(self.ty()).as_deref(), &**value) {
                (Some("bool"), _) => quote!(#kind::Bool(#value)),
                (Some("f64" | "f32"), _) => quote!(#kind::Number(#value)),
                (Some(name), _) if INTEGERS.contains(&name) => {
                    quote!(#kind::Integer((#value) as i64))
                }
                (_, Expr::Lit(ExprLit { lit: Lit::Int(_), .. })) => quote!(#kind::Integer(#value)),
                (_, Expr::Lit(_)) => quote!(#kind::Text(#value)),
                _ => quote!(#kind::Text(#value.name())),
            },
            None if self.is_optional() || within("Vec", &self.field.ty).is_some() => {
                quote!(#kind::Absent)
            }
            None => quote!(#kind::Required),
        }
    }
}

const INTEGERS: [&str; 7] = ["u8", "u16", "u32", "u64", "usize", "i32", "i64"];

/// Least and greatest of a range `a..=b` or `a..`.
pub(crate) fn ends(range: &Expr, greatest: &TokenStream) -> Result<(TokenStream, TokenStream)> {
    let error =
        || Error::new(range.span(), "a range with its ends: a..=b, or a.. without an upper end");
    let Expr::Range(ExprRange { start: Some(start), end, limits, .. }) = range else {
        return Err(error());
    };
    match (end, limits) {
        (Some(end), RangeLimits::Closed(_)) => Ok((quote!(#start), quote!(#end))),
        (None, _) => Ok((quote!(#start), greatest.clone())),
        _ => Err(error()),
    }
}

/// `T` of `Option<T>` or `Vec<T>`.
fn within<'a>(outer: &str, ty: &'a Type) -> Option<&'a Type> {
    let Type::Path(path) = ty else { return None };
    let last = path.path.segments.last().filter(|segment| segment.ident == outer)?;
    let PathArguments::AngleBracketed(arguments) = &last.arguments else { return None };
    match arguments.args.first() {
        Some(GenericArgument::Type(ty)) => Some(ty),
        _ => None,
    }
}

fn name_of(ty: &Type) -> Option<String> {
    match ty {
        Type::Path(path) => path.path.get_ident().map(ToString::to_string),
        _ => None,
    }
}

/// Whether an expression is a text in quotation marks.
fn is_text(expression: &Expr) -> bool {
    matches!(expression, Expr::Lit(ExprLit { lit: Lit::Str(_), .. }))
}
