//! The functions of a file: how long they are and how many arguments they take.

use super::source::{attributes_of, is_test};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// A function with a body.
pub struct Function {
    /// Its name.
    pub name: String,
    /// Line of its signature, from 1.
    pub line: usize,
    /// Lines from the signature to the closing brace.
    pub num_lines: usize,
    /// Arguments, `self` included.
    pub num_arguments: usize,
}

/// All functions with a body, tests left out.
pub fn functions(file: &syn::File) -> Vec<Function> {
    let mut reader = Reader { functions: Vec::new() };
    reader.visit_file(file);
    reader.functions
}

struct Reader {
    functions: Vec<Function>,
}

impl Reader {
    fn add(&mut self, signature: &syn::Signature, body: &syn::Block) {
        let line = signature.span().start().line;
        self.functions.push(Function {
            name: signature.ident.to_string(),
            line,
            num_lines: body.span().end().line + 1 - line,
            num_arguments: signature.inputs.len(),
        });
    }
}

impl<'a> Visit<'a> for Reader {
    fn visit_item(&mut self, item: &'a syn::Item) {
        if !is_test(attributes_of(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_fn(&mut self, function: &'a syn::ItemFn) {
        self.add(&function.sig, &function.block);
        visit::visit_item_fn(self, function);
    }

    fn visit_impl_item_fn(&mut self, function: &'a syn::ImplItemFn) {
        if !is_test(&function.attrs) {
            self.add(&function.sig, &function.block);
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_trait_item_fn(&mut self, function: &'a syn::TraitItemFn) {
        if let Some(body) = &function.default {
            self.add(&function.sig, body);
        }
        visit::visit_trait_item_fn(self, function);
    }
}
