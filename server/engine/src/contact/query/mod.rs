//! What is asked of a pair and what is told of it: question, options, outcome; and the task that is made of a question.

pub mod options;
pub mod outcome;
pub mod question;
pub mod task;
