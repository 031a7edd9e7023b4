//! Rules compiled: for two bodies, in two look-ups, the plan of their pair or none.
//!
//! A plan is looked up once, when its pair enters the list of neighbours; a step runs its pairs plan by plan. So what no
//! rule asks for is looked at nowhere.
//!
//! The first rule that names a pair decides (effects of a scene); an exception passes the pair on to the rules behind. A
//! pair that no rule names is off once there are rules; without rules every pair has the default plan.

use crate::contact::{QueryOptions, margin};
use contactd_proto::{Detect, Effects, InitialOverlap, Report, Rule};
use std::collections::HashMap;

/// What is done for a pair: what its rule asks for. Its `detect` is never off: such pairs have no plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairPlan(pub Effects);

impl std::ops::Deref for PairPlan {
    type Target = Effects;

    fn deref(&self) -> &Effects {
        &self.0
    }
}

impl PairPlan {
    /// The plan of pairs in a scene without rules.
    pub const DEFAULT: Self = Self(Effects::DEFAULT);

    /// What it asks of a search. Regions are asked for beside it. Where the end of the step alone is looked at nothing is past.
    pub fn query_options(&self) -> QueryOptions {
        QueryOptions {
            report: self.report.min(Report::Contact),
            penetration: self.penetration,
            past_overlap: self.initial_overlap == InitialOverlap::IgnoreIfSeparating && self.detect != Detect::Discrete,
        }
    }

    /// A distance beyond which nothing of the margin matters.
    pub fn reach(&self) -> f64 {
        self.margin * (1.0 + 2.0 * margin::MARGIN_SLACK)
    }

    /// True when it is told of a clear pair that it is near.
    pub fn reports_nearness(&self) -> bool {
        self.margin > 0.0 || self.report >= Report::Patch
    }

    /// True when the least distance over the step is told.
    pub fn reports_clearance(&self) -> bool {
        self.clearance > 0.0
    }

    /// True when contact regions are told: for patches, and of pairs within a margin whose contacts are told.
    pub fn reports_regions(&self) -> bool {
        self.report >= Report::Patch || (self.margin > 0.0 && self.report >= Report::Contact)
    }
}

/// The rules of a scene, and which of them can name which pair of groups.
#[derive(Clone, Debug, Default)]
pub struct Plans {
    rules: Vec<Rule>,
    /// The different plans of the rules.
    plans: Vec<PairPlan>,
    /// Index of each rule's plan.
    plan_of: Vec<u32>,
    groups: Vec<String>,
    by_name: HashMap<String, u32>,
    /// For groups (g, h) that some rule is between: the rules that can name their pairs, in order.
    table: HashMap<(u32, u32), Vec<u32>>,
    /// Largest margin of each group.
    margins: Vec<f64>,
    /// Whether some rule that names a group asks for clearances; empty where none does.
    measured: Vec<bool>,
}

impl Plans {
    /// Index of a group, new ones are appended.
    pub fn group(&mut self, name: &str) -> u32 {
        if let Some(g) = self.by_name.get(name) {
            return *g;
        }
        let g = self.groups.len() as u32;
        self.groups.push(name.into());
        self.by_name.insert(name.into(), g);
        self.compile();
        g
    }

    /// The name of a group; empty for an index that has none.
    pub fn group_name(&self, group: u32) -> &str {
        self.groups.get(group as usize).map_or("", String::as_str)
    }

    /// Replaces the rules.
    pub fn set(&mut self, rules: Vec<Rule>) {
        self.plans.clear();
        self.plan_of.clear();
        for plan in rules.iter().map(|rule| PairPlan(rule.effects())) {
            let same = self.plans.iter().position(|p| *p == plan);
            let index = same.unwrap_or_else(|| {
                self.plans.push(plan);
                self.plans.len() - 1
            });
            self.plan_of.push(index as u32);
        }
        self.rules = rules;
        self.compile();
    }

    /// The rules in force.
    pub fn rules(&self) -> &[Rule] {
        &self.rules
    }

    /// How far the margins of the rules that name a group reach; 0 for most.
    pub fn margin_of(&self, group: u32) -> f64 {
        self.margins.get(group as usize).copied().unwrap_or(0.0)
    }

    /// True where some rule asks for clearances.
    pub fn measures(&self) -> bool {
        !self.measured.is_empty()
    }

    /// True for a group of which some rule asks for clearances.
    pub fn is_measured(&self, group: u32) -> bool {
        self.measured.get(group as usize).is_some_and(|measured| *measured)
    }

    /// The plan of an index.
    pub fn plan(&self, index: u32) -> &PairPlan {
        self.plans.get(index as usize).unwrap_or(&PairPlan::DEFAULT)
    }

    /// How many different plans there are.
    pub fn count(&self) -> usize {
        self.plans.len().max(1)
    }

    /// Index of the plan of the pair of two objects by group and name; `None`: the pair is off.
    pub fn of(&self, groups: [u32; 2], names: [&str; 2]) -> Option<u32> {
        if self.rules.is_empty() {
            return Some(0);
        }
        let [g, h] = groups;
        for r in self.table.get(&(g, h))? {
            let rule = &self.rules[*r as usize];
            let both = [self.groups[g as usize].as_str(), self.groups[h as usize].as_str()];
            if rule.except.is_empty() || rule.names(both, names) {
                let plan = self.plan_of[*r as usize];
                return (self.plan(plan).detect != Detect::Off).then_some(plan);
            }
        }
        None
    }

    fn compile(&mut self) {
        self.table.clear();
        self.margins.clear();
        self.margins.resize(self.groups.len(), 0.0);
        self.measured.clear();
        let asks = |rule: &Rule| rule.detect != Detect::Off && PairPlan(rule.effects()).reports_clearance();
        if self.rules.iter().any(asks) {
            self.measured.resize(self.groups.len(), false);
        }
        for (r, rule) in self.rules.iter().enumerate() {
            let [p, q] = rule.between.each_ref().map(|name| self.by_name.get(name).copied());
            let (Some(p), Some(q)) = (p, q) else { continue };
            for group in [p, q] {
                let margin = &mut self.margins[group as usize];
                *margin = margin.max(if rule.detect == Detect::Off { 0.0 } else { PairPlan(rule.effects()).reach() });
            }
            if asks(rule) {
                (self.measured[p as usize], self.measured[q as usize]) = (true, true);
            }
            for key in [(p, q), (q, p)].into_iter().take(if p == q { 1 } else { 2 }) {
                self.table.entry(key).or_default().push(r as u32);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(a: &str, b: &str) -> Rule {
        Rule::new([a.into(), b.into()])
    }

    #[test]
    fn the_first_rule_that_names_a_pair_decides() {
        let mut plans = Plans::default();
        let [robot, cell, tool] = ["robot", "cell", "tool"].map(|g| plans.group(g));
        assert_eq!(plans.of([robot, tool], ["r", "t"]).map(|p| plans.plan(p)), Some(&PairPlan::DEFAULT));
        let mut first = rule("cell", "robot");
        first.except = vec![["gripper".into(), "part".into()], ["gripper".into(), "plate".into()]];
        let mut second = rule("robot", "cell");
        second.detect = Detect::Discrete;
        second.except = vec![["plate".into(), "gripper".into()]];
        let mut off = rule("tool", "tool");
        off.detect = Detect::Off;
        plans.set(vec![first, second, off, rule("tool", "tool")]);
        let detect = |g, n| plans.of(g, n).map(|p| plans.plan(p).detect);
        assert_eq!(detect([robot, cell], ["arm", "part"]), Some(Detect::Continuous));
        assert_eq!(detect([cell, robot], ["part", "gripper"]), Some(Detect::Discrete));
        assert_eq!(detect([robot, cell], ["gripper", "plate"]), None);
        assert_eq!(detect([tool, tool], ["a", "b"]), None);
        assert_eq!(detect([tool, robot], ["a", "b"]), None);
        assert_eq!((plans.count(), plans.margin_of(robot)), (3, 0.0));
    }

    #[test]
    fn a_margin_is_of_the_groups_that_its_rule_names() {
        let mut plans = Plans::default();
        let [robot, cell, tool] = ["robot", "cell", "tool"].map(|g| plans.group(g));
        let wide = |detect| Rule { margin: 2.0, detect, ..rule("robot", "cell") };
        plans.set(vec![wide(Detect::Continuous), rule("robot", "tool")]);
        let reach = wide(Detect::Continuous).margin * (1.0 + 2.0 * margin::MARGIN_SLACK);
        assert_eq!([robot, cell, tool].map(|g| plans.margin_of(g)), [reach, reach, 0.0]);
        plans.set(vec![wide(Detect::Off), rule("robot", "tool")]);
        assert_eq!([robot, cell, tool].map(|g| plans.margin_of(g)), [0.0; 3]);
    }
}
