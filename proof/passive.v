(** The theorems on passivity for springs, dampers, walls and one body, machine-checked.

    coqc passive.v       a few seconds; it prints the axioms that the theorems use, those of Coq's real numbers alone

    Equation numbers are those of docs/theory.md. Torques that a law resists with are [f], the torque on the puck is [-f]. *)

From Coq Require Import Arith Reals Lra Lia Psatz.
Open Scope R_scope.

Ltac by_cases :=
  unfold Rmax, Rmin, Rabs;
  repeat match goal with
         | |- context [Rle_dec ?a ?b] => destruct (Rle_dec a b)
         | |- context [Rcase_abs ?a] => destruct (Rcase_abs a)
         | H : ~ _ <= _ |- _ => apply Rnot_le_lt in H
         end.

Lemma weighted_square (a x : R) : 0 <= a -> 0 <= a * (x * x).
Proof. intros H. apply Rmult_le_pos; [exact H | apply Rle_0_sqr]. Qed.

(** * Laws of the position: (T35) *)

(** Where a law rises by no more than [K], its energy rises by no more than the work against the torque at the start, and [K d^2/2]. *)
Definition rises_by (K : R) (V f : R -> R) : Prop :=
  forall z d : R, V (z + d) - V z <= f z * d + K * d * d / 2.

Lemma derivative_is (f g : R -> R) (x l l' : R) :
  derivable_pt_lim f x l -> (forall t, f t = g t) -> l = l' -> derivable_pt_lim g x l'.
Proof.
  intros H Hfg <- eps He. destruct (H eps He) as [r Hr]. exists r. intros h H0 H1. rewrite <- !Hfg. now apply Hr.
Qed.

(** Every law that is the derivative of its energy, nonlinear or not; falling slopes cost nothing. *)
Lemma law_of_slope (K : R) (V f : R -> R) :
  (forall z, derivable_pt_lim V z (f z)) ->
  (forall x y, x <= y -> f y - f x <= K * (y - x)) ->
  rises_by K V f.
Proof.
  intros HV Hf z d.
  (* What is left over, as a function of the place: it rises away from z. *)
  pose (g := fun t => f z * (t - z) + K * (t - z) * (t - z) / 2 - V t).
  pose (g' := fun t => f z + K * (t - z) - f t).
  assert (Hg : forall t, derivable_pt_lim g t (g' t)).
  { intro t. pose proof (derivable_pt_lim_minus _ _ t _ _ (derivable_pt_lim_id t) (derivable_pt_lim_const z t)) as Hway.
    pose proof (derivable_pt_lim_scal _ (f z) t _ Hway) as Hline.
    pose proof (derivable_pt_lim_scal _ (K / 2) t _ (derivable_pt_lim_mult _ _ t _ _ Hway Hway)) as Hsquare.
    eapply derivative_is; [exact (derivable_pt_lim_minus _ _ t _ _ (derivable_pt_lim_plus _ _ t _ _ Hline Hsquare) (HV t)) | |];
      unfold g, g', plus_fct, minus_fct, mult_fct, mult_real_fct, fct_cte, id; [intro |]; field. }
  assert (Hz : g z = - V z) by (unfold g; field).
  assert (Hd : g (z + d) = f z * d + K * d * d / 2 - V (z + d)) by (unfold g; field).
  enough (g z <= g (z + d)) by lra.
  destruct (Rtotal_order d 0) as [H | [H | H]].
  - destruct (MVT_cor2 g g' (z + d) z) as [c [Hc [H1 H2]]]; [lra | intros; apply Hg |].
    assert (f z - f c <= K * (z - c)) by (apply Hf; lra).
    assert (g' c <= 0) by (unfold g'; lra). nra.
  - subst d. replace (z + 0) with z by ring. lra.
  - destruct (MVT_cor2 g g' z (z + d)) as [c [Hc [H1 H2]]]; [lra | intros; apply Hg |].
    assert (f c - f z <= K * (c - z)) by (apply Hf; lra).
    assert (0 <= g' c) by (unfold g'; lra). nra.
Qed.

Lemma spring_rises (k rest : R) :
  rises_by k (fun q => k * (q - rest) * (q - rest) / 2) (fun q => k * (q - rest)).
Proof. intros z d. nra. Qed.

(** A wall's depth. *)
Definition depth (at_ q : R) : R := Rmax 0 (q - at_).

Lemma wall_rises (k at_ : R) : 0 <= k ->
  rises_by k (fun q => k * depth at_ q * depth at_ q / 2) (fun q => k * depth at_ q).
Proof.
  intros Hk z d. unfold depth.
  assert (H : forall x y, 0 <= k -> Rmax 0 y * Rmax 0 y / 2 - Rmax 0 x * Rmax 0 x / 2
                            <= Rmax 0 x * (y - x) + (y - x) * (y - x) / 2).
  { intros x y _. pose proof (Rle_0_sqr (y - x)) as Hs. unfold Rsqr in Hs. by_cases; nra. }
  specialize (H (z - at_) (z + d - at_) Hk).
  replace (z + d - at_ - (z - at_)) with d in H by ring.
  apply (Rmult_le_compat_l k) in H; [cbv beta; lra | exact Hk].
Qed.

(** Several laws on one puck. *)
Lemma rises_plus (K1 K2 : R) (V1 f1 V2 f2 : R -> R) :
  rises_by K1 V1 f1 -> rises_by K2 V2 f2 ->
  rises_by (K1 + K2) (fun q => V1 q + V2 q) (fun q => f1 q + f2 q).
Proof. intros H1 H2 z d. specialize (H1 z d). specialize (H2 z d). nra. Qed.

(** A wall's damping: the torque never pulls, and is off that of the spring alone by no more than [b |v|]. *)
Lemma damped_wall (k b s v : R) : 0 <= k -> 0 <= b -> 0 < s ->
  Rabs (Rmax 0 (k * s + b * v) - k * s) <= b * Rabs v.
Proof.
  intros Hk Hb Hs. assert (0 <= k * s) by nra.
  by_cases; nra.
Qed.

(** The same where a limit clamps the sum. *)
Lemma clamped_less (m x y : R) : Rabs (Rmax (- m) (Rmin m x) - Rmax (- m) (Rmin m y)) <= Rabs (x - y).
Proof.
  assert (Hmax : forall a s t, Rabs (Rmax a s - Rmax a t) <= Rabs (s - t)) by (intros; by_cases; lra).
  assert (Hmin : forall a s t, Rabs (Rmin a s - Rmin a t) <= Rabs (s - t)) by (intros; by_cases; lra).
  eapply Rle_trans; [apply Hmax | apply Hmin].
Qed.

(** * One body: a spring [k] and a damper [c] to the puck, [kg] and [cg] to ground, and laws with energies [P] and [U] *)

Section Body.

Variables (T J k c kg cg : R) (P U : R -> R).
Hypothesis HT : 0 < T.
Hypotheses (HJ : 0 <= J) (Hk : 0 <= k) (Hc : 0 <= c) (Hkg : 0 <= kg) (Hcg : 0 <= cg).

Definition stored (z w v : R) : R :=
  J * v * v / 2 + k * (z - w) * (z - w) / 2 + kg * w * w / 2 + P (z - w) + U w.

(** What the theorem asks of a step from [w, v] to [w', v']: with the puck held at [z] the energy rises by no more than the damper brings in
    from the puck's velocity [u], its mean over the interval before. The exact hold has this property: there the energy falls by the
    integral of [c (dw/dt - u) dw/dt], and the mean of a square is no less than the square of the mean. *)
Definition does_not_gain (z u w v w' v' : R) : Prop :=
  stored z w' v' - stored z w v <= - T * c * ((w' - w) / T) * ((w' - w) / T - u).

(** The torque [g] of a law over the step: its discrete gradient, so that the work against it is what the energy gains, or more than that,
    where it also damps. *)
Definition takes (V : R -> R) (q q' g : R) : Prop := V q' - V q <= g * (q' - q).

Lemma discrete_gradient (V : R -> R) (q q' : R) : q' <> q -> takes V q q' ((V q' - V q) / (q' - q)).
Proof. intros H. unfold takes. right. field. lra. Qed.

(** A wall with damping [bw] beside its discrete gradient [g]: together they never pull. *)
Lemma damped_wall_takes (V : R -> R) (q q' g bw : R) : 0 <= g -> 0 <= bw ->
  takes V q q' g -> takes V q q' (Rmax 0 (g + bw * ((q' - q) / T))).
Proof.
  unfold takes. intros Hg Hbw H.
  assert (HT' : 0 < / T) by (apply Rinv_0_lt_compat; exact HT).
  destruct (Rle_dec q q') as [Hq | Hq].
  - assert (0 <= bw * ((q' - q) / T)) by (apply Rmult_le_pos; [exact Hbw | apply Rmult_le_pos; lra]).
    by_cases; nra.
  - apply Rnot_le_lt in Hq. assert (0 <= bw * ((q - q') / T)) by (apply Rmult_le_pos; [exact Hbw | apply Rmult_le_pos; lra]).
    replace (bw * ((q' - q) / T)) with (- (bw * ((q - q') / T))) by (field; lra). by_cases; nra.
Qed.

Lemma trapezoidal_does_not_gain (z u w v w' v' gp gu : R) :
  takes P (z - w) (z - w') gp -> takes U w w' gu ->
  w' - w = T * ((v + v') / 2) ->
  J * (v' - v) = T * (k * (z - (w + w') / 2) - kg * ((w + w') / 2) - c * ((v + v') / 2 - u) - cg * ((v + v') / 2) + gp - gu) ->
  does_not_gain z u w v w' v'.
Proof.
  unfold takes, does_not_gain, stored. intros Hp Hu Hw Hv.
  assert (Hm : (w' - w) / T = (v + v') / 2) by (rewrite Hw; field; lra).
  rewrite Hm. set (m := (v + v') / 2) in *.
  assert (Hkin : J * v' * v' / 2 - J * v * v / 2 = J * (v' - v) * m) by (unfold m; field).
  assert (Hwork : J * (v' - v) * m
    = (w' - w) * (k * (z - (w + w') / 2) - kg * ((w + w') / 2)) - T * c * m * (m - u) - T * cg * m * m + gp * (w' - w) - gu * (w' - w)).
  { rewrite Hv, Hw. ring. }
  pose proof (weighted_square (T * cg) m ltac:(nra)).
  nra.
Qed.

Lemma backward_euler_does_not_gain (z u w v w' v' gp gu : R) :
  takes P (z - w) (z - w') gp -> takes U w w' gu ->
  w' - w = T * v' ->
  J * (v' - v) = T * (k * (z - w') - kg * w' - c * (v' - u) - cg * v' + gp - gu) ->
  does_not_gain z u w v w' v'.
Proof.
  unfold takes, does_not_gain, stored. intros Hp Hu Hw Hv.
  assert (Hm : (w' - w) / T = v') by (rewrite Hw; field; lra).
  rewrite Hm.
  assert (Hkin : J * v' * v' / 2 - J * v * v / 2 = J * (v' - v) * v' - J * ((v' - v) * (v' - v)) / 2) by field.
  assert (Hwork : J * (v' - v) * v'
    = (w' - w) * (k * (z - w') - kg * w') - T * c * v' * (v' - u) - T * cg * v' * v' + gp * (w' - w) - gu * (w' - w)).
  { rewrite Hv, Hw. ring. }
  assert (Hspring : k * (z - w') * (z - w') / 2 - k * (z - w) * (z - w) / 2 <= - (w' - w) * (k * (z - w')))
    by (pose proof (weighted_square k (w' - w) Hk); nra).
  assert (Hground : kg * w' * w' / 2 - kg * w * w / 2 <= (w' - w) * (kg * w'))
    by (pose proof (weighted_square kg (w' - w) Hkg); nra).
  pose proof (weighted_square J (v' - v) HJ).
  pose proof (weighted_square (T * cg) v' ltac:(nra)).
  nra.
Qed.

(** Held: the puck stands still, [u = 0], and no step raises the energy. *)
Theorem held (z w v w' v' : R) : does_not_gain z 0 w v w' v' -> stored z w' v' <= stored z w v.
Proof.
  unfold does_not_gain. intros H. set (m := (w' - w) / T) in *.
  pose proof (weighted_square (T * c) m ltac:(nra)). nra.
Qed.

(** Laws between puck and ground, of energy [V], and what dampers and damped walls at the puck add to them, [r]. *)
Variables (K0 KP B : R) (V f p : R -> R).
Hypotheses (HV : rises_by K0 V f) (HP : rises_by KP P p) (HK0 : 0 <= K0) (HKP : 0 <= KP) (HB : 0 <= B).

(** The torque of the end of the step: positions of the end, mean velocities. *)
Definition torque (z u w w' r : R) : R := - f z - k * (z - w') + c * ((w' - w) / T - u) - p (z - w') + r.

(** (T23) with dampers: one interval, in which the puck goes by [d] and its mean velocity is [d/T] to the loop. *)
Lemma one_interval (z d u w v w' v' r : R) :
  does_not_gain z u w v w' v' -> Rabs r <= B * Rabs u ->
  stored (z + d) w' v' + V (z + d) - (stored z w v + V z)
    <= - torque z u w w' r * d + (K0 + k + KP) * d * d / 2 + T * (B + c) * (u * u + (d / T) * (d / T)) / 2.
Proof.
  unfold does_not_gain. intros Hstep Hr.
  set (m := (w' - w) / T) in *. set (u' := d / T) in *.
  assert (Hd : d = T * u') by (unfold u'; field; lra).
  assert (Hmove : stored (z + d) w' v' - stored z w' v'
                    <= (k * (z - w') + p (z - w')) * d + (k + KP) * d * d / 2).
  { unfold stored. specialize (HP (z - w') d). replace (z + d - w') with (z - w' + d) by ring. nra. }
  specialize (HV z d).
  assert (Hrd : r * d <= T * B * (u * u + u' * u') / 2).
  { assert (H1 : r * u' <= Rabs r * Rabs u').
    { rewrite <- Rabs_mult. apply Rle_abs. }
    assert (H2 : Rabs r * Rabs u' <= B * Rabs u * Rabs u') by (apply Rmult_le_compat_r; [apply Rabs_pos | exact Hr]).
    assert (H3 : Rabs u * Rabs u' <= (u * u + u' * u') / 2).
    { assert (Rabs u * Rabs u = u * u) by (unfold Rabs; destruct (Rcase_abs u); ring).
      assert (Rabs u' * Rabs u' = u' * u') by (unfold Rabs; destruct (Rcase_abs u'); ring).
      pose proof (Rle_0_sqr (Rabs u - Rabs u')). unfold Rsqr in *. nra. }
    assert (H4 : r * u' <= B * ((u * u + u' * u') / 2)) by nra.
    rewrite Hd. nra. }
  assert (Hdamper : T * c * ((m - u) * (u' - m)) <= T * c * ((u * u + u' * u') / 2)).
  { apply Rmult_le_compat_l; [nra |].
    pose proof (Rle_0_sqr (m - (u + u') / 2)). pose proof (Rle_0_sqr (u + u')). unfold Rsqr in *. nra. }
  unfold torque. fold m. rewrite Hd in *. nra.
Qed.

(** * Every hand, every pattern of intervals up to [L]: (T24), (T40) *)

Variables (b L : R).
Hypothesis Hb : L * ((K0 + k + KP) / 2 + (B + c) / T) <= b.

(** The puck at the samples, the body, the torques of dampers and walls; the intervals; the puck's kinetic energy; what its damping takes.
    The last is the integral of [b v^2] over the interval, which is no less than [b d^2/h] (Cauchy and Schwarz). *)
Variables (z w v r h kinetic loss : nat -> R).
Definition way (n : nat) : R := z (S n) - z n.
Definition mean (n : nat) : R := match n with O => 0 | S n => way n / T end.

Hypothesis Hstep : forall n, does_not_gain (z n) (mean n) (w n) (v n) (w (S n)) (v (S n)).
Hypothesis Hr : forall n, Rabs (r n) <= B * Rabs (mean n).
Hypothesis Hh : forall n, 0 < h n <= L.
Hypothesis Hloss : forall n, b * (way n * way n) <= loss n * h n.

(** The hand's work in an interval: the device's balance (T21), the torque held. *)
Definition work (n : nat) : R :=
  kinetic (S n) - kinetic n + loss n - torque (z n) (mean n) (w n) (w (S n)) (r n) * way n.

Fixpoint total (n : nat) : R := match n with O => 0 | S n => total n + work n end.

Definition energy (n : nat) : R := kinetic n + stored (z n) (w n) (v n) + V (z n).

Lemma damping_pays (n : nat) :
  (K0 + k + KP) * way n * way n / 2 + T * (B + c) * (way n / T * (way n / T)) <= loss n.
Proof.
  destruct (Hh n) as [H0 H1]. specialize (Hloss n).
  set (d := way n) in *. set (Q := (K0 + k + KP) / 2 + (B + c) / T) in *.
  replace ((K0 + k + KP) * d * d / 2 + T * (B + c) * (d / T * (d / T))) with (Q * (d * d)) by (unfold Q; field; lra).
  assert (HQ : 0 <= Q).
  { unfold Q. assert (0 <= (B + c) / T) by (apply Rmult_le_pos; [lra | left; apply Rinv_0_lt_compat; exact HT]). lra. }
  assert (h n * Q <= b) by nra.
  assert (0 <= d * d) by nra.
  apply (Rmult_le_reg_l (h n)); [exact H0 |]. nra.
Qed.

Lemma work_so_far (n : nat) : energy n - energy 0 + T * (B + c) * (mean n * mean n) / 2 <= total n.
Proof.
  induction n as [| n IH]; [simpl; lra |].
  pose proof (one_interval (z n) (way n) (mean n) (w n) (v n) (w (S n)) (v (S n)) (r n) (Hstep n) (Hr n)) as H.
  pose proof (damping_pays n) as Hp.
  replace (z n + way n) with (z (S n)) in H by (unfold way; ring).
  change (total (S n)) with (total n + work n). change (mean (S n)) with (way n / T).
  unfold work, energy in *. lra.
Qed.

(** No hand draws more than was stored, whatever it does: its work never falls below the energy at the start, with the sign reversed. *)
Theorem passive :
  (forall n, 0 <= kinetic n) -> (forall q, 0 <= V q) -> (forall q, 0 <= P q) -> (forall q, 0 <= U q) ->
  forall n, - energy 0 <= total n.
Proof.
  intros Hkin HV0 HP0 HU0 n. pose proof (work_so_far n) as H.
  assert (0 <= energy n).
  { unfold energy, stored. specialize (Hkin n). specialize (HV0 (z n)). specialize (HP0 (z n - w n)). specialize (HU0 (w n)).
    pose proof (weighted_square J (v n) HJ). pose proof (weighted_square k (z n - w n) Hk).
    pose proof (weighted_square kg (w n) Hkg). lra. }
  pose proof (weighted_square (T * (B + c)) (mean n) ltac:(nra)).
  lra.
Qed.

End Body.

(** * A wheel on a spring and a damper, and a damped wall for the puck: the above in numbers *)

Section Wheel.

Variables (T J k c kw bw at_ b L : R).
Hypotheses (HT : 0 < T) (HJ : 0 <= J) (Hk : 0 <= k) (Hc : 0 <= c) (Hkw : 0 <= kw) (Hbw : 0 <= bw).
Hypothesis Hb : L * ((kw + k) / 2 + (bw + c) / T) <= b.

(** Pushes while the puck is beyond its face, and never pulls. *)
Definition wall (q u : R) : R := if Rlt_dec 0 (q - at_) then Rmax 0 (kw * (q - at_) + bw * u) else 0.

Lemma wall_and_spring (q u : R) : Rabs (kw * depth at_ q - wall q u) <= bw * Rabs u.
Proof.
  pose proof (Rabs_pos u). unfold wall, depth. destruct (Rlt_dec 0 (q - at_)) as [H0 | H0].
  - rewrite (Rmax_right 0 (q - at_)) by lra. rewrite Rabs_minus_sym. apply damped_wall; assumption.
  - rewrite (Rmax_left 0 (q - at_)) by lra. replace (kw * 0 - 0) with 0 by ring. rewrite Rabs_R0. nra.
Qed.

Variables (z w v h kinetic loss : nat -> R).
Let u (n : nat) : R := mean T z n.

(** The trapezoidal rule for the wheel, the puck held at its sample with the velocity that the difference gives. *)
Hypothesis Hw : forall n, w (S n) - w n = T * ((v n + v (S n)) / 2).
Hypothesis Hv : forall n, J * (v (S n) - v n) = T * (k * (z n - (w n + w (S n)) / 2) - c * ((v n + v (S n)) / 2 - u n)).
Hypothesis Hh : forall n, 0 < h n <= L.
Hypothesis Hloss : forall n, b * (way z n * way z n) <= loss n * h n.
Hypothesis Hkin : forall n, 0 <= kinetic n.

(** The torque on the puck that the loop commands at sample [n]. *)
Definition commanded (n : nat) : R := k * (w (S n) - z n) + c * ((w (S n) - w n) / T - u n) - wall (z n) (u n).

Fixpoint hand (n : nat) : R :=
  match n with O => 0 | S n => hand n + (kinetic (S n) - kinetic n + loss n - commanded n * way z n) end.

Theorem wheel_is_passive (n : nat) :
  - (kinetic 0%nat + J * v 0%nat * v 0%nat / 2 + k * (z 0%nat - w 0%nat) * (z 0%nat - w 0%nat) / 2
     + kw * depth at_ (z 0%nat) * depth at_ (z 0%nat) / 2) <= hand n.
Proof.
  pose (none := fun _ : R => 0).
  pose (r := fun n => kw * depth at_ (z n) - wall (z n) (u n)).
  assert (Hnone : rises_by 0 none none) by (intros q d; unfold none; lra).
  pose proof (passive T J k c 0 none none HT HJ Hk Hc (Rle_refl 0) kw 0 bw
                (fun q => kw * depth at_ q * depth at_ q / 2) (fun q => kw * depth at_ q) none
                (wall_rises kw at_ Hkw) Hnone Hkw (Rle_refl 0) Hbw b L) as H.
  specialize (H ltac:(replace (kw + k + 0) with (kw + k) by ring; exact Hb) z w v r h kinetic loss).
  specialize (H (fun n => trapezoidal_does_not_gain T J k c 0 0 none none HT (Rle_refl 0)
                   (z n) (u n) (w n) (v n) (w (S n)) (v (S n)) 0 0
                   ltac:(unfold takes, none; lra) ltac:(unfold takes, none; lra) (Hw n) ltac:(rewrite Hv; ring))).
  specialize (H (fun n => wall_and_spring (z n) (u n)) Hh Hloss Hkin).
  assert (Hwall : forall q, 0 <= kw * depth at_ q * depth at_ q / 2) by (intro q; pose proof (weighted_square kw (depth at_ q) Hkw); lra).
  specialize (H Hwall (fun _ => Rle_refl 0) (fun _ => Rle_refl 0) n).
  assert (Hsame : hand n = total T k c (fun q => kw * depth at_ q) none z w r kinetic loss n).
  { clear H. induction n as [| m IH]; [reflexivity |]. cbn [hand total]. rewrite IH. f_equal.
    unfold work, torque, commanded, r, none, u. ring. }
  rewrite Hsame. unfold energy, stored in H. subst none. cbv beta in *. lra.
Qed.

End Wheel.

(** * A delay of whole samples: (T35) *)

Section Sums.

Fixpoint sum (g : nat -> R) (n : nat) : R := match n with O => 0 | S n => sum g n + g n end.

(** What was [i] samples ago, 0 before the first. *)
Definition ago (i : nat) (g : nat -> R) (n : nat) : R := if Nat.leb i n then g (n - i)%nat else 0.

Lemma sum_le (g g' : nat -> R) (n : nat) : (forall m, g m <= g' m) -> sum g n <= sum g' n.
Proof. intros H. induction n as [| n IH]; simpl; [lra | specialize (H n); lra]. Qed.

Lemma sum_plus (g g' : nat -> R) (n : nat) : sum (fun m => g m + g' m) n = sum g n + sum g' n.
Proof. induction n as [| n IH]; simpl; [ring | rewrite IH; ring]. Qed.

Lemma sum_times (x : R) (g : nat -> R) (n : nat) : sum (fun m => x * g m) n = x * sum g n.
Proof. induction n as [| n IH]; simpl; [ring | rewrite IH; ring]. Qed.

Lemma sum_ago (i : nat) (g : nat -> R) (n : nat) : (forall m, 0 <= g m) -> sum (ago i g) n <= sum g n.
Proof.
  intros Hg.
  assert (H : forall n, sum (ago i g) n = sum g (n - i)).
  { induction n0 as [| m IH]; [reflexivity |]. cbn [sum]. rewrite IH. unfold ago.
    destruct (Nat.leb_spec i m) as [Hi | Hi].
    - replace (S m - i)%nat with (S (m - i)) by lia. reflexivity.
    - replace (S m - i)%nat with 0%nat by lia. replace (m - i)%nat with 0%nat by lia. simpl. ring. }
  rewrite H. generalize (Nat.le_sub_l n i). generalize (n - i)%nat. intros m Hm.
  induction Hm as [| n' Hm IH]; [lra | simpl; specialize (Hg n'); lra].
Qed.

(** The product of what is and of what was sums up to no more than the squares. *)
Lemma sum_product (i : nat) (a : nat -> R) (n : nat) : sum (fun m => a m * ago i a m) n <= sum (fun m => a m * a m) n.
Proof.
  pose proof (sum_ago i (fun m => a m * a m) n (fun m => Rle_0_sqr (a m))) as H.
  assert (Hs : forall m, a m * ago i a m <= / 2 * (a m * a m + ago i (fun m => a m * a m) m)).
  { intro m. unfold ago. destruct (Nat.leb i m).
    - pose proof (Rle_0_sqr (a m - a (m - i)%nat)). unfold Rsqr in *. lra.
    - pose proof (Rle_0_sqr (a m)). unfold Rsqr in *. lra. }
  pose proof (sum_le _ _ n Hs) as Hsum. rewrite sum_times, sum_plus in Hsum. lra.
Qed.

(** The way of the last [d] samples. *)
Fixpoint near (d : nat) (a : nat -> R) (n : nat) : R := match d with O => 0 | S e => near e a n + ago d a n end.

Lemma sum_near (d : nat) (a : nat -> R) (n : nat) : sum (fun m => a m * near d a m) n <= INR d * sum (fun m => a m * a m) n.
Proof.
  induction d as [| d IH].
  - cbn [near INR]. rewrite (Rmult_0_l). induction n as [| n IHn]; simpl in *; lra.
  - assert (H : sum (fun m => a m * near (S d) a m) n = sum (fun m => a m * near d a m) n + sum (fun m => a m * ago (S d) a m) n).
    { rewrite <- sum_plus. clear. induction n as [| n IH]; [reflexivity |]. cbn [sum]. rewrite IH. cbn [near]. ring. }
    rewrite H, S_INR. pose proof (sum_product (S d) a n). lra.
Qed.

End Sums.

Section Delay.

Variables (T K B b : R) (d : nat) (V f : R -> R).
Hypotheses (HT : 0 < T) (HK : 0 <= K) (HB : 0 <= B).
Hypotheses (HV : rises_by K V f) (Hslope : forall x y, Rabs (f x - f y) <= K * Rabs (x - y)).
Hypothesis Hb : T * K * (1 / 2 + INR d) + B <= b.

(** The torque of sample [n - d] acts from sample [n] on; before the first has arrived, that of the place at which the puck is at first. *)
Variables (z r kinetic loss : nat -> R).
Definition step_of (n : nat) : R := z (S n) - z n.
Definition speed (n : nat) : R := Rabs (step_of n) / T.
Hypothesis Hr : forall n, Rabs (r n) <= B * ago (S d) speed n.
Hypothesis Hloss : forall n, b * (step_of n * step_of n) <= loss n * T.

Definition work_late (n : nat) : R := kinetic (S n) - kinetic n + loss n + (f (z (n - d)%nat) - r n) * step_of n.

Lemma way_since (e n : nat) : Rabs (z n - z (n - e)%nat) <= near e (fun m => Rabs (step_of m)) n.
Proof.
  induction e as [| e IH].
  - rewrite Nat.sub_0_r. replace (z n - z n) with 0 by ring. rewrite Rabs_R0. simpl. lra.
  - cbn [near]. unfold ago at 1. destruct (Nat.leb_spec (S e) n) as [H | H].
    + replace (n - e)%nat with (S (n - S e)) in IH by lia.
      replace (z n - z (n - S e)%nat) with ((z n - z (S (n - S e))) + step_of (n - S e)) by (unfold step_of; ring).
      eapply Rle_trans; [apply Rabs_triang | lra].
    + replace (n - S e)%nat with (n - e)%nat by lia. lra.
Qed.

Lemma one_late_interval (n : nat) :
  let a := fun m => Rabs (step_of m) in
  kinetic (S n) + V (z (S n)) - (kinetic n + V (z n)) + K * (1 / 2 + INR d) * (a n * a n) + B / T * (a n * a n)
    <= work_late n + K * (a n * near d a n) + B / T * (a n * ago (S d) a n) + K / 2 * (a n * a n).
Proof.
  intro a. pose proof (HV (z n) (step_of n)) as H. replace (z n + step_of n) with (z (S n)) in H by (unfold step_of; ring).
  assert (Hsquare : a n * a n = step_of n * step_of n) by (unfold a, Rabs; destruct (Rcase_abs _); ring).
  assert (Hold : (f (z n) - f (z (n - d)%nat)) * step_of n <= K * (a n * near d a n)).
  { apply Rle_trans with (Rabs (f (z n) - f (z (n - d)%nat)) * a n); [change (a n) with (Rabs (step_of n)); rewrite <- Rabs_mult; apply Rle_abs |].
    pose proof (Rmult_le_compat_l K _ _ HK (way_since d n)) as Hway. fold a in Hway.
    specialize (Hslope (z n) (z (n - d)%nat)).
    assert (0 <= a n) by apply Rabs_pos. nra. }
  assert (Hdamper : r n * step_of n <= B / T * (a n * ago (S d) a n)).
  { apply Rle_trans with (Rabs (r n) * a n); [change (a n) with (Rabs (step_of n)); rewrite <- Rabs_mult; apply Rle_abs |].
    assert (Hago : ago (S d) speed n = ago (S d) a n / T) by (unfold ago, speed, a; destruct (Nat.leb _ _); field; lra).
    specialize (Hr n). rewrite Hago in Hr. apply (Rmult_le_compat_r (a n)) in Hr; [| apply Rabs_pos].
    replace (B / T * (a n * ago (S d) a n)) with (B * (ago (S d) a n / T) * a n) by (field; lra). exact Hr. }
  assert (Hpays : K * (1 / 2 + INR d) * (a n * a n) + B / T * (a n * a n) <= loss n).
  { rewrite Hsquare. specialize (Hloss n). apply (Rmult_le_reg_l T); [exact HT |].
    replace (T * (K * (1 / 2 + INR d) * (step_of n * step_of n) + B / T * (step_of n * step_of n)))
      with ((T * K * (1 / 2 + INR d) + B) * (step_of n * step_of n)) by (field; lra).
    apply (Rmult_le_compat_r (step_of n * step_of n)) in Hb; [lra | apply Rle_0_sqr]. }
  unfold work_late. nra.
Qed.

(** (T35): b >= T K (1/2 + d) + B is enough. *)
Theorem passive_late :
  (forall n, 0 <= kinetic n) -> (forall q, 0 <= V q) -> forall n, - (kinetic 0 + V (z 0%nat)) <= sum work_late n.
Proof.
  intros Hkin HV0 n. set (a := fun m => Rabs (step_of m)).
  assert (H : kinetic n + V (z n) - (kinetic 0%nat + V (z 0%nat)) + (K * INR d + B / T) * sum (fun m => a m * a m) n
    <= sum work_late n + K * sum (fun m => a m * near d a m) n + B / T * sum (fun m => a m * ago (S d) a m) n).
  { induction n as [| n IH]; [simpl; lra |]. pose proof (one_late_interval n) as Hn. cbv zeta in Hn. fold a in Hn.
    cbn [sum]. lra. }
  pose proof (Rmult_le_compat_l K _ _ HK (sum_near d a n)) as Hnear.
  assert (HBT : 0 <= B / T) by (apply Rmult_le_pos; [lra | left; apply Rinv_0_lt_compat; exact HT]).
  pose proof (Rmult_le_compat_l (B / T) _ _ HBT (sum_product (S d) a n)) as Hago.
  specialize (Hkin n). specialize (HV0 (z n)). lra.
Qed.

End Delay.

Print Assumptions law_of_slope.
Print Assumptions passive.
Print Assumptions wheel_is_passive.
Print Assumptions passive_late.
