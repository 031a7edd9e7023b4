use super::*;
use crate::math::random::Random;

/// Of these faces the last three are the first three again.
const FACES: u32 = 6;
const DISTINCT: u32 = 3;

fn alike() -> Alike {
    Alike { first: (0..FACES).map(|f| f % DISTINCT).collect(), ..Alike::default() }
}

fn literal(face: u32, sense: Sense) -> Tree {
    Tree::One(LiteralId::new(face, sense))
}

fn positive(face: u32) -> Tree {
    literal(face, Sense::Positive)
}

fn negative(face: u32) -> Tree {
    literal(face, Sense::Negative)
}

fn below(r: &mut Random, end: u32) -> u32 {
    (r.unit() * f64::from(end)) as u32
}

fn tokens_of(tree: &Tree) -> Vec<Token> {
    let mut tokens = Vec::new();
    tree.write(&mut tokens);
    tokens
}

/// A tree of literals; operators of one kind may stand in each other.
fn random_tree(r: &mut Random, levels: u32) -> Tree {
    if levels == 0 || below(r, 4) == 0 {
        let sense = if below(r, 2) == 0 { Sense::Positive } else { Sense::Negative };
        return literal(below(r, FACES), sense);
    }
    let and = below(r, 2) == 0;
    let operands = 2 + below(r, 3);
    Tree::Many(and, (0..operands).map(|_| random_tree(r, levels - 1)).collect())
}

/// What an expression is where each distinct face holds as told: deep on its positive side, on its negative one, on neither.
fn value(e: &Tree, at: &[Option<Sense>]) -> bool {
    match e {
        Tree::Known(v) => *v,
        Tree::One(id) => at[(id.face() % DISTINCT) as usize] == Some(id.sense()),
        Tree::Part(_) => unreachable!("none is drawn"),
        Tree::Many(true, all) => all.iter().all(|e| value(e, at)),
        Tree::Many(false, all) => all.iter().any(|e| value(e, at)),
    }
}

fn left_of(tree: &Tree) -> Tree {
    let mut left = Vec::new();
    match alike().simplified(&tokens_of(tree), &mut left) {
        Truth::True => Tree::Known(true),
        Truth::False => Tree::Known(false),
        Truth::Open => Tree::of(&left),
    }
}

#[test]
fn what_is_left_holds_just_where_the_whole_does() {
    let mut r = Random(41);
    let (mut smaller, mut decided) = (0, 0);
    for _ in 0..3_000 {
        let tree = random_tree(&mut r, 4);
        let left = left_of(&tree);
        smaller += usize::from(left.size() < tree.size());
        decided += usize::from(matches!(left, Tree::Known(_)));
        for case in 0..3_usize.pow(DISTINCT) {
            let at = |face: u32| [None, Some(Sense::Positive), Some(Sense::Negative)][case / 3_usize.pow(face) % 3];
            let at: Vec<_> = (0..DISTINCT).map(at).collect();
            assert_eq!(value(&left, &at), value(&tree, &at), "{tree:?} -> {left:?} at {at:?}");
        }
    }
    assert!(smaller > 1_000 && decided > 300, "{smaller} smaller, {decided} decided");
}

#[test]
fn an_alternative_goes_that_contradicts_others_through_what_it_leaves_of_one_beside_it() {
    // The first alternative leaves of the second operand its last, which the third does not go with.
    let first = Tree::Many(false, vec![positive(0), negative(1)]);
    let second = Tree::Many(false, vec![negative(3), positive(1)]);
    let third = Tree::Many(false, vec![negative(0), negative(4)]);
    let tree = Tree::Many(true, vec![first, second, third]);
    let left = left_of(&tree);
    assert!(!format!("{left:?}").contains(&format!("{:?}", positive(0))), "{left:?}");
}

#[test]
fn a_plate_with_holes_up_to_the_same_heights_is_looked_at_in_proportion_to_its_size() {
    let looked = |holes: u32| {
        // A side for each hole; all tops are one plane and all bottoms another.
        let face = |i| i + 6;
        let first = (0..6).chain((0..3 * holes).map(|i| if i % 3 == 0 { face(i) } else { face(i % 3) })).collect();
        let hole = |i| Tree::Many(false, (0..3).map(|k| negative(face(3 * i + k))).collect());
        let tree = Tree::Many(true, (0..6).map(positive).chain((0..holes).map(hole)).collect());
        let (alike, mut seats, mut left) = (Alike { first, ..Alike::default() }, Seats::default(), Vec::new());
        let tokens = tokens_of(&tree);
        assert!(alike.any_twice(&tokens, &mut seats));
        let (truth, looked) = alike.simplified_with(&mut seats, &tokens, &mut left);
        assert_eq!((truth, left.len()), (Truth::Open, tokens.len()));
        assert!(looked < 20 * tokens.len(), "{looked} for {} tokens", tokens.len());
        looked
    };
    assert!(looked(8_000) < 9 * looked(1_000));
}
