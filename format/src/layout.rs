//! The layout of a text: which pieces begin lines, and in which columns all of them stand.
//!
//! The pieces are placed one after another. When one goes beyond the width, the outermost list that is open
//! there and can be broken on this line is broken, and the line is placed once more, shorter. Each step adds
//! a break, so this ends; and since a list is never broken right of [`MAX_COLUMN`], texts that nest deeply
//! stay about as long as they are.

use std::collections::{HashMap, HashSet};
use std::ops::RangeInclusive;

use esl_compiler::reader::lexer::Token;
use esl_syntax::{LineStarts, NodeId, SyntaxKind, SyntaxTree};

use super::breaks::{BreakLevel, BreakMode, WIDTH};
use super::comments::align_comments;
use super::edit::Edit;
use super::indent::{NodePlaces, Shapes};
use super::pieces::{PieceKind, TextPiece, pieces};
use super::style::Styles;

/// The rightmost column in which a line begins that the formatter itself makes.
const MAX_COLUMN: usize = 80;
/// Columns that are gained at least where an element leaves its place beside the operator, and where one does
/// so rather than that it is broken itself.
const MIN_GAIN: usize = 8;
const LARGE_GAIN: usize = 16;
/// Blank lines between top-level forms, and inside a form.
const BLANK_LINES: [usize; 2] = [2, 1];

/// How much of a text is laid out anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LayoutExtent {
    /// Blanks inside lines, breaks and indentation.
    All,
    /// Indentation: lines keep their breaks and their blanks.
    Indentation,
}

/// The blank space before a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lead {
    /// The space in the text.
    AsIs,
    /// So many blanks.
    Blanks(usize),
    /// So many newlines, then blanks.
    Lines(usize, usize),
}

/// Where a piece stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedPiece {
    pub(super) lead: Lead,
    /// Line and column of the beginning, and of the end.
    pub(super) start: (usize, usize),
    pub(super) end: (usize, usize),
}

/// An element of an open list with which the current line could be broken.
#[derive(Clone, Copy)]
struct BreakPoint {
    list: NodeId,
    first: usize,
    last: usize,
}

pub(super) struct Layout<'a> {
    pub(super) tree: &'a SyntaxTree,
    pub(super) lines: &'a LineStarts,
    pub(super) pieces: Vec<TextPiece>,
    pub(super) placed: Vec<PlacedPiece>,
    shapes: Shapes<'a>,
    places: NodePlaces,
    pub(super) extent: LayoutExtent,
    /// For each node the number of its first piece.
    piece_of: Vec<u32>,
    /// For each piece whether a line is to begin with it.
    breaks: Vec<bool>,
    /// For each node whether a line was broken inside it.
    is_broken: Vec<bool>,
    /// How lists are broken, as far as that was asked for; and those whose elements have got their breaks.
    modes: HashMap<NodeId, BreakMode>,
    divided: HashSet<NodeId>,
    /// For lists in which a line was broken whether they are filled anew.
    filled: HashMap<NodeId, bool>,
    /// For each piece whether it is a comment that goes on with one behind code, on the line before.
    pub(super) follows: Vec<bool>,
    /// The places where the current line could be broken: those of the outermost list first.
    ready: Vec<BreakPoint>,
    willing: Vec<BreakPoint>,
    reluctant: Vec<BreakPoint>,
}

/// Lays out a text, or those of its lines that are wanted. Returns what changes, in order.
pub(super) fn lay_out(
    tree: &SyntaxTree,
    styles: &Styles,
    wanted: Option<RangeInclusive<usize>>,
    extent: LayoutExtent,
) -> Vec<Edit> {
    let lines = LineStarts::new(tree.source());
    let is_wanted = |line: usize| wanted.as_ref().is_none_or(|wanted| wanted.contains(&line));
    let pieces = pieces(tree, &lines, is_wanted);
    let count = tree.nodes().end as usize;
    let mut piece_of = vec![0; count];
    for (at, piece) in pieces.iter().enumerate().filter(|(_, piece)| piece.kind != PieceKind::Close) {
        piece_of[piece.node as usize] = at as u32;
    }
    let mut layout = Layout {
        tree,
        lines: &lines,
        placed: Vec::with_capacity(pieces.len()),
        shapes: Shapes::new(tree, styles),
        places: NodePlaces::new(tree),
        extent,
        piece_of,
        breaks: vec![false; pieces.len()],
        is_broken: vec![false; count],
        modes: HashMap::new(),
        divided: HashSet::new(),
        filled: HashMap::new(),
        follows: Vec::new(),
        ready: Vec::new(),
        willing: Vec::new(),
        reluctant: Vec::new(),
        pieces,
    };
    layout.find_followers();
    layout.place_all();
    align_comments(&mut layout);
    layout.edits(is_wanted(lines.count() - 1))
}

impl Layout<'_> {
    fn find_followers(&mut self) {
        for at in 0..self.pieces.len() {
            let follows = at > 0 && self.is_below(at - 1, at) && {
                let is_behind_code = at > 1 && !self.gap(at - 1).contains('\n');
                is_behind_code || self.follows[at - 1]
            };
            self.follows.push(follows);
        }
    }

    /// Whether two comments stand under each other, the second one with a single semicolon.
    fn is_below(&self, above: usize, at: usize) -> bool {
        let (above, piece) = (self.pieces[above], self.pieces[at]);
        above.kind == PieceKind::Comment
            && piece.kind == PieceKind::Comment
            && !self.tree.text(piece.node).starts_with(";;")
            && self.lines.line_of(above.start) + 1 == self.lines.line_of(piece.start)
            && self.old_column(above.start) == self.old_column(piece.start)
    }

    fn place_all(&mut self) {
        let mut at = 0;
        while at < self.pieces.len() {
            let lead = self.lead(at);
            self.place(at, lead);
            match self.break_before(at) {
                Some(first) => {
                    self.placed.truncate(first);
                    at = first;
                }
                None => at += 1,
            }
        }
    }

    /// Returns the text before a piece: blanks.
    pub(super) fn gap(&self, at: usize) -> &str {
        let before = match at.checked_sub(1) {
            Some(before) => self.pieces[before].end,
            None if self.tree.source().starts_with('\u{feff}') => '\u{feff}'.len_utf8(),
            None => 0,
        };
        let end = self.pieces.get(at).map_or(self.tree.source().len(), |piece| piece.start);
        &self.tree.source()[before..end]
    }

    fn lead(&mut self, at: usize) -> Lead {
        let piece = self.pieces[at];
        let gap = self.gap(at);
        // A page break is not only a blank.
        if piece.is_kept || gap.contains('\u{c}') {
            return Lead::AsIs;
        }
        let newlines = gap.matches('\n').count();
        let blanks = gap.len();
        let wanted = match at.checked_sub(1) {
            None if self.extent == LayoutExtent::All => Lead::Lines(0, 0),
            None => Lead::Lines(newlines, 0),
            Some(_) if self.extent == LayoutExtent::Indentation => match newlines {
                0 => Lead::Blanks(blanks),
                _ => Lead::Lines(newlines, 0),
            },
            Some(before) => self.spaced(before, at, newlines),
        };
        match wanted {
            Lead::Lines(newlines, _) => Lead::Lines(newlines, self.column(at)),
            lead => lead,
        }
    }

    /// Returns what belongs between two pieces between which there are `newlines`.
    fn spaced(&mut self, before: usize, at: usize, newlines: usize) -> Lead {
        let (left, piece) = (self.pieces[before], self.pieces[at]);
        let is_comment = piece.kind == PieceKind::Comment;
        match (left.kind, piece.kind) {
            (PieceKind::Comment, PieceKind::Close) => return Lead::Lines(1, 0),
            (_, PieceKind::Close) => return Lead::Blanks(0),
            (PieceKind::Open | PieceKind::Mark, PieceKind::Comment | PieceKind::BlockComment) => {
                return match newlines {
                    0 => Lead::Blanks(usize::from(is_comment || !self.gap(at).is_empty())),
                    _ => Lead::Lines(1, 0),
                };
            }
            (PieceKind::Open, _) => return Lead::Blanks(0),
            (PieceKind::Mark, _) => return Lead::Blanks(usize::from(self.would_join(left, piece))),
            _ => {}
        }
        let is_top = self.tree.parent(piece.node) == Some(SyntaxTree::ROOT);
        let blank_lines = BLANK_LINES[usize::from(!is_top)];
        let is_filled = newlines == 1
            && !self.filled.is_empty()
            && self.tree.parent(piece.node).is_some_and(|list| self.filled.get(&list) == Some(&true));
        if newlines > 0 && !is_filled {
            return Lead::Lines(newlines.min(blank_lines + 1), 0);
        }
        if left.kind == PieceKind::Comment {
            return Lead::Lines(1, 0);
        }
        if is_comment {
            return Lead::Blanks(self.gap(at).chars().count().max(1));
        }
        self.break_after_broken(piece.node);
        if self.breaks[at] { Lead::Lines(1, 0) } else { Lead::Blanks(1) }
    }

    /// Whether a mark and what it applies to would be another token without a blank: `, @x`.
    fn would_join(&self, mark: TextPiece, piece: TextPiece) -> bool {
        let text = &self.tree.source()[piece.start..piece.end];
        self.tree.kind(mark.node) == SyntaxKind::Mark(Token::Comma) && text.starts_with(['@', '.'])
    }

    /// Begins a line with an element if a line was broken inside the one before it.
    fn break_after_broken(&mut self, node: NodeId) {
        let Some(before) = self.shapes.before(node).filter(|&before| self.is_broken[before as usize]) else {
            return;
        };
        let level = self.shapes.break_level(node);
        let is_beside = self.shapes.index(before) == 0 && level != BreakLevel::Ready;
        if level != BreakLevel::Never && !is_beside {
            let at = self.piece_of[node as usize] as usize;
            self.break_list(self.tree.parent(node).unwrap_or(SyntaxTree::ROOT), at);
            self.breaks[at] = true;
        }
    }

    /// Returns the column of a piece that begins a line.
    fn column(&self, at: usize) -> usize {
        let piece = self.pieces[at];
        if piece.kind == PieceKind::Close {
            return self.places.wanted_end(&self.shapes, piece.node);
        }
        if self.follows[at] {
            return self.placed[at - 1].start.1;
        }
        let wanted = self.places.wanted(&self.shapes, piece.node);
        wanted.unwrap_or_else(|| self.old_column(piece.start))
    }

    /// Whether a placed piece is the first on its line.
    pub(super) fn begins_line(&self, at: usize) -> bool {
        match self.placed[at].lead {
            Lead::Lines(..) => true,
            Lead::Blanks(_) => false,
            Lead::AsIs => at == 0 || self.gap(at).contains('\n'),
        }
    }

    /// Returns the column that a position has in the text.
    pub(super) fn old_column(&self, offset: usize) -> usize {
        let start = self.lines.range(self.lines.line_of(offset)).start;
        self.tree.source()[start..offset].trim_start_matches('\u{feff}').chars().count()
    }

    fn place(&mut self, at: usize, lead: Lead) {
        let piece = self.pieces[at];
        let before = at.checked_sub(1).map_or((0, 0), |before| self.placed[before].end);
        let start = match lead {
            Lead::AsIs => after(before, self.gap(at)),
            Lead::Blanks(count) => (before.0, before.1 + count),
            Lead::Lines(newlines, column) => (before.0 + newlines, column),
        };
        let end = after(start, &self.tree.source()[piece.start..piece.end]);
        self.placed.push(PlacedPiece { lead, start, end });
        let is_first = self.begins_line(at);
        if is_first {
            self.ready.clear();
            self.willing.clear();
            self.reluctant.clear();
        }
        if piece.kind != PieceKind::Close {
            self.places.put(piece.node, start.1, end.1, is_first);
        }
    }

    /// Looks whether a piece that was just placed is beyond the width, and whether its line can be broken.
    /// Returns the first piece that begins a line instead.
    fn break_before(&mut self, at: usize) -> Option<usize> {
        let piece = self.pieces[at];
        let PlacedPiece { start, end, lead } = self.placed[at];
        if self.extent == LayoutExtent::Indentation || piece.kind == PieceKind::Comment {
            return None;
        }
        if matches!(lead, Lead::Blanks(_))
            && !matches!(piece.kind, PieceKind::Close | PieceKind::BlockComment)
        {
            self.add_break_point(at);
        }
        let width = match end.0 == start.0 {
            true => end.1,
            // The first line of a string.
            false => {
                let text = &self.tree.source()[piece.start..piece.end];
                start.1 + text.lines().next().map_or(0, |line| line.chars().count())
            }
        };
        let is_wide = width > WIDTH;
        let (point, is_ready) = self.break_point().filter(|_| is_wide).unzip();
        if piece.kind == PieceKind::Close {
            for points in [&mut self.ready, &mut self.willing, &mut self.reluctant] {
                points.pop_if(|point| point.list == piece.node);
            }
        }
        let (point, is_ready) = (point?, is_ready?);
        if is_ready && self.break_mode(point.list) != BreakMode::Fill {
            self.break_list(point.list, point.first);
            if let Some(first) = (point.first..=point.last).find(|&at| self.breaks[at]) {
                return Some(first);
            }
        }
        self.mark_broken(point.list);
        self.breaks[point.last] = true;
        let shapes = &self.shapes;
        self.filled.entry(point.list).or_insert_with(|| shapes.is_plain(point.list));
        Some(point.last)
    }

    /// Returns where the current line is to be broken, and whether the list is to be broken as a whole. An
    /// outer list begins before an inner one, and has a smaller number.
    fn break_point(&self) -> Option<(BreakPoint, bool)> {
        let [ready, willing, reluctant] =
            [&self.ready, &self.willing, &self.reluctant].map(|points| points.first().copied());
        match (ready, willing) {
            (Some(ready), Some(willing)) if willing.list < ready.list => Some((willing, false)),
            (Some(ready), _) => Some((ready, true)),
            (None, willing) => willing.or(reluctant).map(|point| (point, false)),
        }
    }

    fn break_mode(&mut self, list: NodeId) -> BreakMode {
        let shapes = &self.shapes;
        *self.modes.entry(list).or_insert_with(|| shapes.break_mode(list))
    }

    /// Lets lines begin with the elements of a list that is not filled, from a piece on that begins one.
    fn break_list(&mut self, list: NodeId, first: usize) {
        self.mark_broken(list);
        let mode = self.break_mode(list);
        if mode == BreakMode::Fill || !self.divided.insert(list) {
            return;
        }
        let mut next = Some(self.pieces[first].node);
        while let Some(node) = next {
            let is_meant = mode == BreakMode::Each || self.shapes.is_keyword(node);
            if is_meant && self.shapes.break_level(node) == BreakLevel::Ready {
                self.breaks[self.piece_of[node as usize] as usize] = true;
            }
            next = self.shapes.after(node);
        }
    }

    fn mark_broken(&mut self, list: NodeId) {
        let mut at = Some(list);
        while let Some(node) = at.filter(|&node| !self.is_broken[node as usize]) {
            self.is_broken[node as usize] = true;
            at = self.tree.parent(node);
        }
    }

    /// Takes a piece as a place where its line could be broken, if it is one.
    fn add_break_point(&mut self, at: usize) {
        let node = self.pieces[at].node;
        let level = self.shapes.break_level(node);
        let list = self.tree.parent(node).unwrap_or(SyntaxTree::ROOT);
        let (here, end) = (self.placed[at].start.1, self.placed[at].end.1);
        let wanted = self.places.wanted(&self.shapes, node).unwrap_or(here);
        let gain = here.saturating_sub(wanted);
        // A long token is as long on a line of its own.
        let is_too_long = wanted + (end - here.min(end)) > WIDTH && self.pieces[at].kind == PieceKind::Leaf;
        let (points, least) = match level {
            BreakLevel::Never => return,
            BreakLevel::Ready => (&mut self.ready, 1),
            BreakLevel::Willing => (&mut self.willing, LARGE_GAIN),
            BreakLevel::Reluctant => (&mut self.reluctant, MIN_GAIN),
        };
        if gain < least || wanted > MAX_COLUMN || is_too_long {
            return;
        }
        match points.last_mut().filter(|point| point.list == list) {
            Some(point) => point.last = at,
            None => points.push(BreakPoint { list, first: at, last: at }),
        }
    }
}

/// Returns the position behind a text that begins at a position.
fn after((line, column): (usize, usize), text: &str) -> (usize, usize) {
    match text.rfind('\n') {
        Some(last) => (line + text.matches('\n').count(), text[last + 1..].chars().count()),
        None => (line, column + text.chars().count()),
    }
}
