//! A struct as a table, an enum as the variants of a tag.

use crate::choice::name_of;
use crate::docs::first_paragraph;
use crate::key::{Key, Role};
use proc_macro2::TokenStream;
use quote::quote;
use syn::spanned::Spanned as _;
use syn::{Data, DataEnum, DeriveInput, Error, Expr, Fields, Ident, Result};

pub(crate) fn section(input: &DeriveInput) -> Result<TokenStream> {
    match &input.data {
        Data::Struct(data) => table(input, &data.fields),
        Data::Enum(data) => variants(&input.ident, data),
        Data::Union(_) => Err(Error::new(input.span(), "a section is a struct or an enum")),
    }
}

fn table(input: &DeriveInput, fields: &Fields) -> Result<TokenStream> {
    let own = &input.ident;
    let doc = first_paragraph(&input.attrs);
    let mut open_tag: Option<Expr> = None;
    for attribute in input.attrs.iter().filter(|own| own.path().is_ident("section")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("tag") {
                open_tag = Some(meta.value()?.parse()?);
                Ok(())
            } else {
                Err(meta.error("only tag can be said here"))
            }
        })?;
    }
    let keys = keys(fields)?;
    let fields = descriptions(&keys)?;
    let tag = match (open_tag, keys.iter().find(|key| key.role() == Role::Tag)) {
        (Some(tag), _) => quote!(::std::option::Option::Some(&#tag)),
        (None, Some(key)) => {
            let (name, doc, default) = (&key.name, key.doc(), key.default_variant());
            let ty = key.ty();
            quote!(::std::option::Option::Some(&::proto::config::Tag {
                key: #name,
                doc: #doc,
                default: #default,
                variants: ::proto::config::Variants::Fixed(<#ty as ::proto::config::Alternatives>::VARIANTS),
            }))
        }
        (None, None) => quote!(::std::option::Option::None),
    };
    let values = keys.iter().map(value);
    let assertions = keys.iter().filter_map(Key::assertion);
    Ok(quote! {
        #(#assertions)*

        impl ::proto::config::Section for #own {
            const SPEC: ::proto::config::TableSpec = ::proto::config::TableSpec {
                doc: #doc,
                fields: #fields,
                tag: #tag,
            };

            fn read(table: &::proto::config::CheckedTable) -> Self {
                Self { #(#values),* }
            }
        }
    })
}

/// The list of descriptions, those of flattened sections in their places.
fn descriptions(keys: &[Key<'_>]) -> Result<TokenStream> {
    let (mut parts, mut counts) = (Vec::new(), Vec::new());
    for run in keys.chunk_by(|one, next| one.role() == next.role()) {
        match run[0].role() {
            Role::Key => {
                let (n, own) = (run.len(), run.iter().map(Key::description));
                let own = own.collect::<Result<Vec<_>>>()?;
                counts.push(quote!(#n));
                parts.push(quote!(&[#(#own),*]));
            }
            Role::Flattened => {
                for ty in run.iter().map(|key| &key.field.ty) {
                    let fields = quote!(<#ty as ::proto::config::Section>::SPEC.fields);
                    counts.push(quote!(#fields.len()));
                    parts.push(fields);
                }
            }
            Role::Tag | Role::Inherited | Role::Skipped => {}
        }
    }
    Ok(quote!(&::proto::config::joined::<{ 0 #(+ #counts)* }>(&[#(#parts),*])))
}

/// The keys of named fields.
fn keys(fields: &Fields) -> Result<Vec<Key<'_>>> {
    match fields {
        Fields::Named(fields) => fields.named.iter().map(Key::of).collect(),
        Fields::Unit => Ok(Vec::new()),
        Fields::Unnamed(fields) => Err(Error::new(fields.span(), "a key needs a name")),
    }
}

/// `field: read(...)`.
fn value(key: &Key<'_>) -> TokenStream {
    let (ident, name, ty) = (&key.field.ident, &key.name, key.ty());
    let tag = || quote!(<#ty as ::proto::config::Alternatives>::read(table, #name));
    match key.role() {
        Role::Key | Role::Inherited => quote!(#ident: ::proto::config::key(table, #name)),
        Role::Flattened => quote!(#ident: ::proto::config::Section::read(table)),
        Role::Skipped => quote!(#ident: ::std::default::Default::default()),
        Role::Tag if key.is_optional() => {
            let read = tag();
            quote!(#ident: #read)
        }
        // A value that is no variant was refused, and nothing stands in its place: none of the keys that go with it is judged.
        Role::Tag => {
            let read = tag();
            quote!(#ident: #read.unwrap_or_else(|| <Self as ::proto::config::Section>::defaults().#ident))
        }
    }
}

fn variants(own: &Ident, data: &DataEnum) -> Result<TokenStream> {
    let mut listed = Vec::new();
    let mut arms = Vec::new();
    for variant in &data.variants {
        let name = name_of(&variant.attrs, "section", &variant.ident.to_string())?;
        let doc = first_paragraph(&variant.attrs);
        let ident = &variant.ident;
        if let Fields::Unnamed(fields) = &variant.fields {
            if fields.unnamed.len() != 1 {
                return Err(Error::new(fields.span(), "one section, or named keys"));
            }
            let ty = &fields.unnamed[0].ty;
            listed.push(quote!(::proto::config::Variant {
                name: #name,
                doc: #doc,
                fields: <#ty as ::proto::config::Section>::SPEC.fields,
            }));
            arms.push(
                quote!(#name => Self::#ident(<#ty as ::proto::config::Section>::read(table))),
            );
            continue;
        }
        let keys = keys(&variant.fields)?;
        let fields = descriptions(&keys)?;
        let values = keys.iter().map(value);
        listed.push(quote!(::proto::config::Variant { name: #name, doc: #doc, fields: #fields }));
        arms.push(quote!(#name => Self::#ident { #(#values),* }));
    }
    Ok(quote! {
        impl ::proto::config::Alternatives for #own {
            const VARIANTS: &'static [::proto::config::Variant] = &[#(#listed),*];

            fn read(table: &::proto::config::CheckedTable, tag: &str) -> ::std::option::Option<Self> {
                ::std::option::Option::Some(match ::proto::config::tag(table, tag)? {
                    #(#arms,)*
                    _ => return ::std::option::Option::None,
                })
            }
        }
    })
}
