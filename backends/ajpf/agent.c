/* A Gwendolen agent as Spin runs it: AIL's reasoning cycle over the program's own tables (agent.h), written apart from
   Avow's interpreter so that the two can be held against each other. Ground terms, intentions: interned, so that a
   state is a few numbers. What it cannot run makes it give up, and then there is no opinion.

   Every name here starts with gw_, except what Spin's model calls: ways, go, says. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "agent.h"

static void gw_give_up(const char *why) {
    printf("gave up: %s\n", why);
    fflush(stdout);
    _exit(3);
}

#include "agent_mind.c"

/* The environment */
static int gw_offered(const short *now, int *found) {
    int g, i, k, n = 0, all[NGROUPS + 1];
    for (g = 0; g < NGROUPS; g++) {
        int t = now[g] < 0 ? -1 : percepts[g][now[g]];
        if (t < 0) continue;
        short none[MAXVARS];
        gw_unbound(none);
        t = gw_ground(t, none);
        for (i = 0; i < n && all[i] != t; i++);
        if (i < n) continue;
        for (k = n++; k && gw_before(t, all[k - 1]); k--) all[k] = all[k - 1];
        all[k] = t;
    }
    memcpy(found, all, n * sizeof(int));
    return n;
}
static int gw_narrowing(int functor) {
    int i;
    for (i = 1; i <= NAFTER; i++)
        if (after[i] == functor) return i;
    return NAFTER + 1;
}
static int gw_count(int row) {
    int g, n = 1;
    for (g = 0; g < NGROUPS; g++) n *= options[row][g][0];
    return n;
}
static void gw_draw(S *s, int row, int way) {
    int g;
    for (g = NGROUPS - 1; g >= 0; g--) {
        int n = options[row][g][0], at = options[row][g][1 + way % n];
        way /= n;
        if (at >= 0) s->now[g] = at;
    }
}

#include "agent_deeds.c"

/* One cycle's first half */
static void gw_choose(S *s) {
    Intention x = gw_its[s->cur];
    Frame *f = &x.f[x.n - 1];
    int i;
    if (f->plan != OPEN) {
        s->planned = 1;
        return;
    }
    for (i = 0; i < NPLANS; i++) {
        short b[MAXVARS];
        if (plans[i].drop != f->drop || plans[i].isgoal != f->isgoal ||
            (f->isgoal && !plans[i].loose && plans[i].kind >= 0 && plans[i].kind != f->kind))
            continue;
        gw_unbound(b);
        if (!gw_match(plans[i].trigger, f->event, b) || !gw_holds(s, plans[i].guard, plans[i].nguard, b, 0)) continue;
        if (!plans[i].n) {
            if (f->isgoal && !f->drop) gw_unwant(s, f->event, f->kind);
            x.n--;
            s->cur = gw_intention(&x);
            s->planned = x.n > 0;
            return;
        }
        if (f->isgoal && plans[i].loose) f->kind = plans[i].kind > 0; /* AIL goes on with the plan's kind */
        f->plan = i;
        f->fresh = 1;
        memcpy(f->b, b, sizeof b);
        s->cur = gw_intention(&x);
        s->planned = 1;
        return;
    }
    if (f->isgoal && !f->drop) {
        if (x.n == MAXFRAMES) gw_give_up("too many goals on goals");
        x.f[x.n] = *f;
        x.f[x.n].drop = 1;
        x.n++;
        s->cur = gw_intention(&x);
        s->planned = 1;
    } else if (f->isgoal)
        s->planned = 1;
    else {
        x.n = 0;
        s->cur = gw_intention(&x);
        s->planned = 0;
    }
}
static void gw_cycle(S *s, int again) {
    int i, k, n, t[NGROUPS + 1], nothing;
    s->planned = 0;
    s->asleep = 0;
    if (s->fresh) {
        short gone[MAXBEL];
        int ngone = 0;
        for (i = 0; i < s->nb; i++)
            if (s->seen[i]) { /* AIL sorts them with their annotations */
                for (k = ngone++; k && gw_order(gw_terms[s->bel[i]].text, "[", gw_terms[gone[k - 1]].text, "[") < 0;
                     k--)
                    gone[k] = gone[k - 1];
                gone[k] = s->bel[i];
            }
        n = gw_offered(s->now, t);
        for (i = 0; i < ngone + n; i++) {
            int it = i < ngone ? gw_single(gone[i], 1, 0, 0, PERCEIVES) : gw_single(t[i - ngone], 0, 0, 0, PERCEIVES);
            for (k = 0; k < s->nq && s->q[k] != it; k++);
            if (k == s->nq) gw_put(s, it);
        }
    }
    s->fresh = again;
    nothing = s->cur < 0 || !gw_its[s->cur].n;
    gw_sift(s);
    if (nothing || (gw_its[s->cur].waiting && !gw_its[s->cur].locked)) {
        int old = nothing ? -1 : s->cur;
        if (!gw_ready(s)) {
            if (old >= 0) gw_put(s, old);
            s->cur = -1;
            s->asleep = 1;
            return;
        }
        s->cur = gw_take(s, 0);
        if (old >= 0) gw_put(s, old);
    } else if (!gw_its[s->cur].locked) {
        for (k = 0; k < s->nq && !gw_its[s->q[k]].waiting; k++);
        gw_put(s, 0);
        for (i = s->nq - 1; i > k; i--) s->q[i] = s->q[i - 1];
        s->q[k] = s->cur;
        s->cur = gw_take(s, 0);
    }
    gw_choose(s);
}

/* The state graph */
static void gw_begin(S *s) {
    int i;
    short none[MAXVARS];
    Intention x;
    memset(&x, 0, sizeof x);
    memset(s, 0, sizeof *s);
    s->up = 1;
    gw_unbound(none);
    for (i = 0; i < NBELIEFS; i++) gw_add(s, gw_ground(beliefs[i], none), 0);
    for (i = 0; i < NGROUPS; i++) s->now[i] = -1;
    s->cur = gw_intention(&x);
    s->last = -1;
    s->fresh = 1;
    s->begun = !AT_START;
    for (i = 0; i < NGOALS; i++) {
        int it = gw_single(gw_ground(goals[i][0], none), 0, 1, goals[i][1], STARTS);
        Intention y = gw_its[it];
        y.f[0].isgoal = 0;
        y.f[0].kind = goals[i][1];
        it = gw_intention(&y);
        if (i)
            gw_put(s, it);
        else
            s->cur = it;
    }
}
static int gw_step(S *s, int way) {
    int found[NGROUPS + 1];
    if (s->over) return 1;
    if (s->planned) return gw_deed(s, way);
    if (s->asleep) {
        int had, now;
        if (QUIESCENCE == 0 || s->waited) {
            if (way >= 0) s->over = 1;
            return 1;
        }
        if (way < 0) return gw_count(NAFTER + 1);
        had = gw_offered(s->now, found) > 0;
        gw_draw(s, NAFTER + 1, way);
        now = gw_offered(s->now, found) > 0;
        s->fresh = s->fresh || had || now;
        s->waited = QUIESCENCE == 1;
        gw_cycle(s, 0);
        if (!now && QUIESCENCE == 1) s->over = 1;
        return 1;
    }
    if (!s->begun) {
        if (way < 0) return gw_count(NAFTER + 2);
        gw_draw(s, NAFTER + 2, way);
        s->begun = 1;
        gw_cycle(s, !PROBED);
        return 1;
    }
    if (way >= 0) gw_cycle(s, 0);
    return 1;
}
int says(const S *s, int atom) {
    short b[MAXVARS];
    int i, found[NGROUPS + 1], n;
    S first;
    if (!s->up) {
        gw_begin(&first);
        s = &first;
    }
    gw_unbound(b);
    switch (atoms[atom].what) {
    case 'B': return gw_believes(s, atoms[atom].pat, b, 0, 0, 0);
    case 'D': return s->last >= 0 && gw_match(atoms[atom].pat, s->last, b);
    case 'G':
        for (i = 0; i < s->ng; i++) {
            short c[MAXVARS];
            memcpy(c, b, sizeof c);
            if (gw_match(atoms[atom].pat, s->goal[i] / 2, c)) return 1;
        }
        return 0;
    default:
        if (!s->fresh || !s->begun || s->over) return 0;
        n = gw_offered(s->now, found);
        for (i = 0; i < n; i++) {
            short c[MAXVARS];
            memcpy(c, b, sizeof c);
            if (gw_match(atoms[atom].pat, found[i], c)) return 1;
        }
        return 0;
    }
}
int ways(const S *s) {
    S copy = *s;
    return s->up ? gw_step(&copy, -1) : 1;
}
void go(S *s, int way) {
    if (s->up)
        gw_step(s, way);
    else
        gw_begin(s);
}
