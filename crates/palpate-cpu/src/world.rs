//! What the backend holds: a world of members, their states, adjoints, tangents and tallies.

use crate::ahead::Ahead;
use crate::costs::{Compared, Costs, Instant, Look};
use crate::kept::Kept;
use crate::linear::Solvers;
use crate::linear::matrix::Matrix;
use crate::linear::vector::Nodes;
use crate::newton::Effort;
use crate::terms::altered::Altered;
use crate::terms::consistent::mass_matrix;
use crate::terms::{Acting, Equation, acting};
use glam::DVec3;
use palpate_engine::{Direction, Evaluation, Failure, ParamBatch};
use palpate_model::cutcells::elements::{Classes, Elements};
use palpate_model::effects::sensors::Sensors;
use palpate_model::mechanics::plane::{PlaneNow, planes};
use palpate_model::observation::Viewed;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use palpate_model::space::pattern::{Pattern, Places};
use std::sync::{Arc, OnceLock};

/// A plan made ready, and the current batch.
#[derive(Debug)]
pub struct World {
    pub(crate) shared: Shared,
    pub(crate) members: Vec<Member>,
}

/// What all members of all batches share.
#[derive(Debug)]
pub struct Shared {
    pub(crate) plan: Plan,
    pub(crate) pattern: Pattern,
    pub(crate) places: Places,
    pub(crate) classes: Classes,
    /// Element matrices at ν = 0, where the material has a viscosity.
    pub(crate) strains: Option<Elements>,
    pub(crate) solvers: Solvers,
    /// Of every recording.
    pub(crate) costs: Vec<Costs>,
}

/// One member's parameters and scratch.
#[derive(Debug)]
pub struct Member {
    pub(crate) theta: Vec<f64>,
    pub(crate) coefficients: Coefficients,
    pub(crate) planes: Vec<PlaneNow>,
    pub(crate) effects: Vec<Acting>,
    pub(crate) sensors: Sensors,
    /// What it is compared with.
    pub(crate) viewed: Viewed,
    /// Number of its own sensitivities; `None` = as many as are requested.
    pub(crate) own: Option<usize>,
    /// 1/n: one over the number of scalar residuals that count.
    pub(crate) scale: f64,
    pub(crate) altered: Altered,
    /// Mass matrix by block [kg], of a body of tetrahedra.
    pub(crate) masses: Vec<f64>,
    pub(crate) elements: Arc<Elements>,
    pub(crate) matrix: Matrix,
    /// Of the time steps since the parameters were set.
    pub(crate) effort: Effort,
    /// Known where the stress-free shape follows from the parameters.
    pub(crate) rates: Option<Rated>,
    /// What balances in the shape given, where effects change the stress-free shape beyond.
    pub(crate) balanced: Option<Box<Balanced>>,
    /// States of a sequence that are known already.
    pub(crate) ahead: Ahead,
    /// What the penalty of a cloud's stars has in every block, over its modulus [m]; once somebody multiplies with it.
    pub(crate) springs: OnceLock<Vec<f64>>,
}

/// Coefficients with the stress-free shape of the shape given.
#[derive(Debug)]
pub(crate) struct Balanced {
    pub(crate) coefficients: Coefficients,
    pub(crate) altered: Altered,
}

/// Directions, and derivatives of the coefficients along them.
#[derive(Clone, Debug)]
pub(crate) struct Rated {
    pub(crate) directions: Arc<Vec<Direction>>,
    pub(crate) rates: Arc<Vec<Coefficients>>,
}

impl Member {
    /// Time of the initial state as the stamps of frames have it [s].
    pub(crate) fn first_stamp(&self) -> f64 {
        self.coefficients.physics.start + self.sensors.ahead()
    }

    /// A frame as this member understands it.
    pub(crate) fn look<'a>(&'a self, shared: &'a Shared, frame: usize) -> Look<'a> {
        Look { plan: &shared.plan, observation: self.viewed.observation(), sensors: &self.sensors, frame }
    }

    /// Frames of step k that count.
    pub(crate) fn instants(&self, shared: &Shared, k: usize) -> Vec<Instant> {
        match &shared.plan.times[..] {
            // A static problem shows all frames one state.
            [] | [_] => self.viewed.instants(shared.plan.clock.step, self.first_stamp(), k),
            times => self.viewed.instants_at(times, k),
        }
    }

    /// Compares a frame with displacement `u` `[N]`.
    pub(crate) fn compare(&self, shared: &Shared, frame: usize, u: Nodes) -> Compared {
        shared.costs[self.viewed.view.recording].compare(self.look(shared, frame), u)
    }

    /// True where a stage is one of those that its recording takes, which follow from the start on.
    pub(crate) fn takes(&self, stage: &Stage) -> bool {
        stage.step < self.viewed.recording.steps
    }
}

impl World {
    /// What the time steps of a member took since its parameters were set.
    pub fn effort(&self, member: usize) -> Effort {
        self.members[member].effort
    }

    pub(crate) fn new(plan: &Plan) -> World {
        let plan = plan.clone();
        let pattern = Pattern::of(&plan);
        let places = Places::new(&plan, &pattern);
        let classes = Classes::new(&plan);
        let strains = plan.layout.is_viscous().then(|| Elements::new(&plan, &classes, 0.0));
        let costs = (0..plan.recordings()).map(|r| Costs::new(&plan, &plan.recording(r).observation)).collect();
        let solvers = Solvers::new(plan.solver.linear);
        World { shared: Shared { plan, pattern, places, classes, strains, solvers, costs }, members: Vec::new() }
    }

    pub(crate) fn set_params(&mut self, theta: &ParamBatch) {
        let shared = &self.shared;
        // Element matrices depend on Poisson's ratio alone: reuse those of this batch and of the one before.
        let mut known: Vec<Arc<Elements>> = self.members.iter().map(|m| m.elements.clone()).collect();
        let mut scratch: Vec<Matrix> = self.members.drain(..).map(|m| m.matrix).collect();
        for b in 0..theta.members() {
            let row = theta.row(b);
            let coefficients = Coefficients::new(&shared.plan, row);
            let physics = &coefficients.physics;
            let elements = known.iter().find(|e| e.nu == physics.poisson_ratio).cloned().unwrap_or_else(|| {
                let e = Arc::new(Elements::new(&shared.plan, &shared.classes, physics.poisson_ratio));
                known.push(e.clone());
                e
            });
            let planes = planes(&shared.plan, physics);
            let effects = acting(&shared.plan, physics);
            let altered = Altered::new(&shared.plan, &coefficients, &elements);
            let masses = mass_matrix(&shared.plan, &shared.pattern, &shared.places, &coefficients);
            let viewed = shared.plan.viewed(&theta.view(b));
            self.members.push(Member {
                theta: row.to_vec(),
                coefficients,
                planes,
                effects,
                sensors: Sensors::new(&shared.plan.layout, row),
                scale: viewed.scale(),
                viewed,
                own: theta.own.get(b).map(Vec::len),
                altered,
                masses,
                elements,
                matrix: scratch.pop().unwrap_or_default(),
                effort: Effort::default(),
                rates: None,
                balanced: None,
                ahead: Ahead::default(),
                springs: OnceLock::new(),
            });
        }
    }
}

/// u [m] and v [m/s] of every member, `[B, N, 3]`.
#[derive(Clone, Debug)]
pub struct State {
    pub(crate) members: Vec<MemberState>,
}

/// u and v of one member.
#[derive(Clone, Debug)]
pub struct MemberState {
    pub(crate) u: Nodes,
    pub(crate) v: Nodes,
}

/// dJ/du and dJ/dv of every member.
#[derive(Clone, Debug)]
pub struct Adjoint {
    pub(crate) members: Vec<MemberState>,
}

/// du/dθ_q and dv/dθ_q of every member.
#[derive(Clone, Debug)]
pub struct Tangent {
    pub(crate) members: Vec<MemberTangent>,
}

/// Tangents of one member, one vector per direction.
#[derive(Clone, Debug)]
pub struct MemberTangent {
    /// The directions, as they are for this member.
    pub(crate) directions: Arc<Vec<Direction>>,
    /// Derivatives of the coefficients along the directions.
    pub(crate) rates: Arc<Vec<Coefficients>>,
    pub(crate) du: Vec<Nodes>,
    pub(crate) dv: Vec<Nodes>,
}

/// Everything to be read of every member.
#[derive(Clone, Debug)]
pub struct Tally {
    pub(crate) members: Vec<MemberTally>,
}

/// Everything to be read of one member.
#[derive(Clone, Debug, Default)]
pub struct MemberTally {
    pub(crate) evaluation: Evaluation,
    /// Derivatives by the coefficients, where a gradient is wanted.
    pub(crate) gradient: Option<Box<Gradient>>,
    /// Frames already compared at the state that they were observed in.
    pub(crate) compared: Vec<Compared>,
}

/// dJ/d(coefficients) of one member, and which of them are wanted.
#[derive(Clone, Debug)]
pub struct Gradient {
    pub(crate) coefficients: Coefficients,
    pub(crate) sought: Sought,
    /// Parameters that are wanted `[P]`.
    pub(crate) wanted: Vec<bool>,
    /// Equilibria whose derivatives wait for those that are solved for with them.
    pub(crate) waiting: Vec<Waiting>,
    /// The tangent that served the last ones.
    pub(crate) kept: Option<Kept>,
}

/// An equilibrium of a sequence with dJ/du.
#[derive(Clone, Debug)]
pub struct Waiting {
    /// Its stage; `None` = the start.
    pub(crate) stage: Option<Stage>,
    pub(crate) at: Nodes,
    pub(crate) by_u: Nodes,
}

impl Gradient {
    /// Zero.
    pub(crate) fn new(plan: &Plan, wanted: Vec<bool>) -> Gradient {
        let sought = Sought::new(plan, &wanted);
        let coefficients = Coefficients::zero_gradient(plan, &sought);
        Gradient { coefficients, sought, wanted, waiting: Vec::new(), kept: None }
    }

    /// Adds −z · ∂r/∂(coefficients) at `u1`.
    pub(crate) fn take(&mut self, equation: &Equation, u1: &[DVec3], z: &[DVec3]) {
        let minus: Nodes = z.iter().map(|z| -*z).collect();
        equation.by_coefficients_transposed(u1, &minus, &self.sought, &mut self.coefficients);
    }
}

impl MemberTally {
    /// A frame as it was compared on the way forward.
    pub(crate) fn find(compared: &[Compared], frame: usize) -> &Compared {
        compared.iter().find(|c| c.frame == frame).expect("every frame was observed on the way forward")
    }

    pub(crate) fn failed(&self) -> bool {
        self.evaluation.failure.is_some()
    }

    /// Marks the member as failed; the values of its parameters go into the message.
    pub(crate) fn fail(&mut self, failure: Failure, plan: &Plan, theta: &[f64]) {
        self.evaluation.failure = Some(failure.in_plan(plan, theta));
    }
}
