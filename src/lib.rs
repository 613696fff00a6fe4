//! `bikebot`: plans, balances and rides a bike robot.
