// The argument behind Avow's side conditions over steps (avow/calculus/discharge.py): nodes answer within a step in the
// order in which values flow; what a delayed edge delivers is of the step before. A(k, t): the assumption of node k holds
// at step t; G(k, t) its guarantee. Whoever assumes may use what comes earlier: earlier nodes at this step, and every
// node at the step before.
module Steps {
  predicate Before(A: (nat, nat) -> bool, G: (nat, nat) -> bool, n: nat, t: nat) {
    t > 0 ==> forall j: nat :: j < n ==> A(j, t - 1) && G(j, t - 1)
  }
  predicate Earlier(A: (nat, nat) -> bool, G: (nat, nat) -> bool, k: nat, t: nat) {
    forall j: nat :: j < k ==> A(j, t) && G(j, t)
  }

  // first step: from the initial values (they are part of what A and G speak of at step 0); later steps: from the step
  // before. Both cases are the one premise here, since Before is true at step 0.
  lemma EveryStep(A: (nat, nat) -> bool, G: (nat, nat) -> bool, n: nat, t: nat)
    requires forall k: nat, s: nat :: k < n && A(k, s) ==> G(k, s)                                   // verified nodes
    requires forall k: nat, s: nat :: k < n && Earlier(A, G, k, s) && Before(A, G, n, s) ==> A(k, s) // side conditions
    ensures forall k: nat :: k < n ==> A(k, t) && G(k, t)
    decreases t
  {
    if t > 0 { EveryStep(A, G, n, t - 1); }
    assert Before(A, G, n, t);
    UpTo(A, G, n, n, t);
  }
  lemma UpTo(A: (nat, nat) -> bool, G: (nat, nat) -> bool, n: nat, m: nat, t: nat)
    requires m <= n
    requires forall k: nat, s: nat :: k < n && A(k, s) ==> G(k, s)
    requires forall k: nat, s: nat :: k < n && Earlier(A, G, k, s) && Before(A, G, n, s) ==> A(k, s)
    requires Before(A, G, n, t)
    ensures Earlier(A, G, m, t)
    decreases m
  {
    if m > 0 {
      UpTo(A, G, n, m - 1, t);
      assert Earlier(A, G, m - 1, t);
      assert A(m - 1, t) && G(m - 1, t);
    }
  }

  // without the order, two nodes that assume each other's guarantee prove nothing
  lemma CircularIsNotEnough() returns (A: (nat, nat) -> bool, G: (nat, nat) -> bool)
    ensures forall k: nat, s: nat :: k < 2 && A(k, s) ==> G(k, s)
    ensures forall s: nat :: (G(1, s) ==> A(0, s)) && (G(0, s) ==> A(1, s))
    ensures !A(0, 0)
  {
    A := (k: nat, s: nat) => false;
    G := (k: nat, s: nat) => false;
  }
}
