"""The tree of topological maps, against an enumeration of all of them."""

from __future__ import annotations

from itertools import product

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.mappers.hssh.map_tree import MapTree, TreeConfig
from albot_core.mappers.hssh.star import ENDS, MAYBE, Merge, Star, merges
from albot_core.mappers.hssh.topological_map import OPEN, Common, Travel, Visit
from albot_experiments.hssh_floor import experience, places_of

END, BEND, LINE = Star(ENDS), Star(ENDS, ENDS), Star(1, 0)
TEE, FORK, CROSS = Star(1, 0, ENDS), Star(ENDS, ENDS, ENDS), Star(2, 3, 0, 1)
STARS = (END, BEND, LINE, TEE, FORK, CROSS)


def enumerated(start: Star, travels: list[Travel], planar: bool) -> set[tuple]:
    """All maps by trying every place and shift for every visit, and checking each map whole."""
    stars = [start, *(travel.star for travel in travels)]
    found = set()
    choices = [[(p, s) for p in range(k + 1) for s in range(len(STARS))] for k in range(len(stars))]
    for chosen in product(*choices[1:]):
        visits = ((0, 0), *chosen)
        if fits(stars, visits) and is_map(stars, travels, visits, planar):
            found.add(numbered(stars, visits))
    return found


def numbered(stars: list[Star], visits: tuple) -> tuple:
    """Visits as the tree has them: for each gateway seen, the gateway of the place."""
    counts = [star.gateways for star in stars]
    return tuple(
        (place, tuple((k + shift) % count for k in range(count)))
        for count, (place, shift) in zip(counts, visits, strict=True)
    )


def fits(stars: list[Star], visits: tuple) -> bool:
    """Places are counted as they come, and each visit's star is that of its place."""
    known: list[Star] = []
    for star, (place, shift) in zip(stars, visits, strict=True):
        if place == len(known):
            known.append(star)
            if shift:
                return False
        if place > len(known) or shift >= max(star.gateways, 1):
            return False
        other = known[place]
        if star.gateways != other.gateways:
            return False
        for k, onward in enumerate(star.continues):
            turned = ENDS if onward == ENDS else (onward + shift) % star.gateways
            if other.continues[(k + shift) % star.gateways] != turned:
                return False
    return True


def is_map(stars: list[Star], travels: list[Travel], visits: tuple, planar: bool) -> bool:
    """The axioms: one partner a gateway, a path once through a place, and a plane."""
    star_of = {}
    for star, (place, _) in zip(stars, visits, strict=True):
        star_of.setdefault(place, star)
    partner: dict = {}
    for k, travel in enumerate(travels):
        (p, s), (q, t) = visits[k], visits[k + 1]
        one = p, (travel.left + s) % star_of[p].gateways
        other = q, (travel.arrived + t) % star_of[q].gateways
        if one == other or partner.get(one, other) != other or partner.get(other, one) != one:
            return False
        partner[one], partner[other] = other, one
    paths = nx.MultiGraph()
    for place, star in star_of.items():
        for k, onward in enumerate(star.continues):
            paths.add_edge(("local", place, min(k, onward if onward != ENDS else k)), (place, k))
    for one, other in partner.items():
        if one < other:
            paths.add_edge(one, other)
    return are_lines(paths) and (not planar or is_planar(star_of, partner))


def are_lines(paths: nx.MultiGraph) -> bool:
    """No path runs in a circle, or through a place twice."""
    for part in nx.connected_components(paths):
        local = [node[1] for node in part if node[0] == "local"]
        if len(local) > len(set(local)):
            return False
        if paths.subgraph(part).number_of_edges() >= len(part):
            return False
    return True


def is_planar(star_of: dict, partner: dict) -> bool:
    """networkx checks the embedding by Euler's formula; gateways are nodes of their own."""
    embedding = nx.PlanarEmbedding()
    for place, star in star_of.items():
        before = None
        for k in range(star.gateways):
            embedding.add_half_edge(("place", place), (place, k), ccw=before)
            before = (place, k)
    for gateway in [(place, k) for place, star in star_of.items() for k in range(star.gateways)]:
        embedding.add_half_edge(gateway, ("place", gateway[0]))
        if gateway in partner:
            embedding.add_half_edge(gateway, partner[gateway], ccw=("place", gateway[0]))
    try:
        embedding.check_structure()
    except nx.NetworkXException:
        return False
    return True


@st.composite
def journeys(draw: st.DrawFn) -> tuple[Star, list[Travel]]:
    start = draw(st.sampled_from(STARS))
    travels, before = [], start
    for _ in range(draw(st.integers(1, 3))):
        star = draw(st.sampled_from(STARS))
        left = draw(st.integers(0, before.gateways - 1))
        travels.append(Travel(left, star, draw(st.integers(0, star.gateways - 1))))
        before = star
    return start, travels


def grown(start: Star, travels: list[Travel], **config: object) -> MapTree:
    tree = MapTree(start, TreeConfig(**config))
    for travel in travels:
        tree.travel(travel)
    return tree


@settings(max_examples=40, deadline=None)
@given(journeys(), st.booleans())
def test_the_leaves_are_all_maps_that_agree(journey, planar):
    start, travels = journey
    tree = grown(start, travels, planar=planar)
    expected = enumerated(start, travels, planar)
    if tree.contradictions:
        assert not expected
    else:
        assert {tuple(map(tuple, each.visits)) for each in tree.maps} == expected


@settings(max_examples=30, deadline=None)
@given(journeys())
def test_paths_are_counted_as_they_are(journey):
    for leaf in grown(*journey).maps:
        starts = {
            tuple(sorted(leaf.path_through((place, k))))
            for place, star in enumerate(leaf.stars)
            for k in range(star.gateways)
        }
        assert leaf.paths >= len(starts)
        links = sum(1 for _ in leaf.edges())
        assert leaf.paths == sum(star.paths for star in leaf.stars) - links


def test_round_a_block_there_are_two_maps():
    """Four corners, then the first again: the block is closed, or goes on for ever."""
    tree = grown(BEND, [Travel(1, BEND, 0)] * 4)
    ranks = [each.rank for each in tree.maps]
    # Back at the first place after two, three or four corners, or at a new one. After two, a path
    # would lead from the place to itself twice over.
    assert ranks == sorted(ranks)
    assert tree.best.rank < tree.maps[-1].rank
    closed = [each for each in tree.maps if not any(True for _ in each.open_gateways())]
    assert all(each.places < 5 for each in closed)
    assert tree.maps[-1].places == 5


def test_a_path_comes_through_a_place_once():
    """Straight on for ever: no crossing is met again, since its path would run in a circle."""
    tree = grown(CROSS, [Travel(2, CROSS, 0)] * 5)
    assert [each.places for each in tree.maps] == [6]
    assert tree.best.path_through((0, 0)) == [5, 4, 3, 2, 1, 0]


def test_a_known_way_tells_the_place():
    tree = grown(TEE, [Travel(0, END, 0), Travel(0, TEE, 0)])
    assert [visit.place for visit in tree.best.visits] == [0, 1, 0]
    assert tree.best.visits[-1].gateways == (0, 1, 2)
    assert len(tree.maps) == 1


def test_a_wrong_perception_is_repaired_and_counted():
    tree = grown(TEE, [Travel(0, END, 0), Travel(0, CROSS, 2)])
    assert tree.contradictions == 1
    assert tree.best.visits[-1].place == 2
    assert tree.best.joined[0][0] == OPEN


def test_evidence_besides_the_stars_prunes():
    tree = MapTree(BEND)
    seen = []

    def judge(first: int, common: Common, closes_loop: bool) -> bool:
        seen.append((first, common, closes_loop))
        return False

    for _ in range(4):
        tree.travel(Travel(1, BEND, 0), judge)
    assert [each.places for each in tree.maps] == [5]
    assert (0, ((0, 0), (1, 1)), True) in seen


def test_the_limit_forgets_the_least_preferred_and_says_so():
    journey = [Travel(1, FORK, 0)] * 6
    whole, few = grown(FORK, journey), grown(FORK, journey, limit=10)
    assert len(whole.maps) > 10
    assert whole.forgotten == 0
    assert len(few.maps) == 10
    assert few.forgotten > 0
    assert few.best.rank >= whole.best.rank


def test_ten_thousand_maps():
    tree = grown(CROSS, [Travel(1, CROSS, 0)] * 10, limit=10_000, planar=False)
    assert len(tree.maps) == 10_000
    assert tree.forgotten > 0


@settings(max_examples=20, deadline=None)
@given(journeys())
def test_a_tree_is_replayed(journey):
    start, travels = journey
    tree = grown(start, travels)
    visits = [each.visits for each in tree.maps]
    twin = MapTree.replayed(start, travels, visits)
    for one, other in zip(tree.maps, twin.maps, strict=True):
        assert (one.firsts, one.joined, one.paths) == (other.firsts, other.joined, other.paths)


START = Visit(0, (0, 1, 2))


@pytest.mark.parametrize(
    "visits",
    [
        [Visit(0, (1, 0, 2)), Visit(1, (0, 1, 2, 3))],  # A first visit in another order.
        [START, Visit(1, (0, 1, 3, 2))],
        [START, Visit(2, (0, 1, 2, 3))],  # A place is left out.
        [START, Visit(1, (0, 1, 2, 4))],  # And a gateway.
    ],
)
def test_visits_that_no_tree_holds_are_refused(visits):
    with pytest.raises(InputError, match="map 0: expected visits that fit the travels"):
        MapTree.replayed(TEE, [Travel(0, CROSS, 0)], [visits])


def test_visits_that_fit_no_travel_are_refused():
    with pytest.raises(InputError, match="map 0: expected visits that fit the travels"):
        MapTree.replayed(TEE, [Travel(0, CROSS, 0)], [[START, Visit(0, (0, 1, 2, 3))]])


@pytest.mark.parametrize(("left", "arrived"), [(3, 0), (0, 4), (-1, 0)])
def test_a_gateway_that_is_not_there_is_refused(left, arrived):
    with pytest.raises(InputError, match="Travel, "):
        MapTree(TEE).travel(Travel(left, CROSS, arrived))


def test_stars_of_one_shape():
    assert TEE.turned(1) == Star(2, ENDS, 0)
    assert TEE.turned(1).kind == TEE.turned(2).kind == TEE.kind
    assert len(merges(CROSS, CROSS, 0)) == 4
    assert [merge.seen for merge in merges(TEE.turned(1), TEE, 0)] == [(1, 2, 0)]
    assert [star.paths for star in STARS] == [1, 2, 1, 2, 3, 2]
    with pytest.raises(InputError, match="Star, gateway 0"):
        Star(0)
    with pytest.raises(InputError, match="Star, unknown: expected numbers below 2"):
        Star(ENDS, ENDS, unknown=[2])


# Places that were not seen whole.


def glimpsed(star: Star, kept: list[int]) -> Star:
    """What is seen of a star whose other gateways lie in unknown arms."""
    continues = [kept.index(k) if k in kept else ENDS for k in (star.continues[g] for g in kept)]
    unknown = {
        sum(other < hidden for other in kept) % len(kept)
        for hidden in range(star.gateways)
        if hidden not in kept
    }
    return Star(*continues, unknown=unknown)


def test_a_gateway_seen_later_refines_the_star():
    """A tee of which one arm was not seen, and the tee."""
    first, whole = glimpsed(TEE, [1, 2]), TEE
    assert first == Star(ENDS, ENDS, unknown=[0])
    (merge,) = (each for each in merges(whole, first, 1) if each.seen[1] == each.known[0])
    assert merge.star.kind == TEE.kind
    assert merge.star.is_whole
    tree = grown(first, [Travel(0, END, 0), Travel(0, whole, 1), Travel(0, END, 0)])
    assert [visit.place for visit in tree.best.visits] == [0, 1, 0, 2]
    assert tree.best.stars[0].kind == TEE.kind
    assert tree.contradictions == 0


def test_an_arm_without_a_gateway_is_whole_in_the_end():
    (merge,) = (each for each in merges(BEND, Star(ENDS, ENDS, unknown=[1]), 0) if not each.seen[0])
    assert merge.star == BEND


def test_what_continues_a_gateway_is_open_where_two_visits_saw_one_gateway_each():
    both = merges(Star(ENDS, unknown=[0]), Star(ENDS, unknown=[0]), 0)
    assert Merge(Star(MAYBE, MAYBE, unknown=[0, 1]), (1,), (0,)) in both
    line = [merge.star for merge in merges(LINE, Star(MAYBE, MAYBE), 0)]
    assert line == [LINE, LINE]


def test_paths_that_differ_on_gateways_that_both_have_are_a_contradiction():
    assert merges(LINE, BEND, 0) == ()
    assert merges(glimpsed(CROSS, [0, 2]), Star(ENDS, ENDS, ENDS, ENDS), 0) == ()


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(STARS), st.data())
def test_two_glimpses_of_a_star_may_be_of_it(star, data):
    count, arrived = star.gateways, data.draw(st.integers(0, star.gateways - 1))
    subsets = [sorted(data.draw(st.sets(st.integers(0, count - 1))) | {arrived}) for _ in range(2)]
    seen, known = (glimpsed(star, kept) for kept in subsets)
    every = sorted({*subsets[0], *subsets[1]})
    zero = every.index(subsets[1][0])
    places = [
        tuple((every.index(gateway) - zero) % len(every) for gateway in kept) for kept in subsets
    ]
    found = [each for each in merges(seen, known, subsets[0].index(arrived))
             if [each.seen, each.known] == places]  # fmt: skip
    assert len(found) == 1
    true = glimpsed(star, every).turned(zero)
    assert found[0].star.unknown >= true.unknown
    for told, is_so in zip(found[0].star.continues, true.continues, strict=True):
        assert told in {is_so, MAYBE}


@settings(max_examples=20, deadline=None)
@given(st.data())
def test_the_correct_map_is_never_pruned(data):
    """On the floor of the experiment, with arms of any visit not seen."""
    star, travels = experience()
    stars = [star, *(travel.star for travel in travels)]
    used = [{travel.left} for travel in travels] + [set()]
    for k, travel in enumerate(travels, start=1):
        used[k].add(travel.arrived)
    hidden = data.draw(st.lists(st.booleans(), min_size=len(stars), max_size=len(stars)))
    kept = [
        [g for g in range(each.gateways) if g in needed or not hides or g % 2]
        for each, needed, hides in zip(stars, used, hidden, strict=True)
    ]
    seen = [glimpsed(each, some) for each, some in zip(stars, kept, strict=True)]
    journey = [
        Travel(kept[k].index(travel.left), seen[k + 1], kept[k + 1].index(travel.arrived))
        for k, travel in enumerate(travels)
    ]
    few = journey[:9]
    tree = grown(seen[0], few, limit=20_000)
    assert tree.contradictions == 0
    assert places_of()[:10] in [[visit.place for visit in leaf.visits] for leaf in tree.maps]
    twin = MapTree.replayed(seen[0], few, [each.visits for each in tree.maps])
    for one, other in zip(tree.maps, twin.maps, strict=True):
        assert (one.stars, one.joined, one.paths) == (other.stars, other.joined, other.paths)


def test_the_preferred_maps_have_the_fewest_paths_and_then_the_fewest_places():
    """On the floor of the experiment, on which planarity prunes maps, and leaves one minimal."""
    star, travels = experience()
    free, planar = grown(star, travels, planar=False), grown(star, travels, planar=True)
    ranks = [(leaf.paths, leaf.places) for leaf in free.maps]
    assert ranks == sorted(ranks)
    assert [leaf.rank for leaf in free.minimal] == [ranks[0]] * ranks.count(ranks[0])
    assert [leaf.visits for leaf in planar.maps] == [
        leaf.visits for leaf in free.maps if leaf.visits in {each.visits for each in planar.maps}
    ]
    assert 1 == len(planar.minimal) < len(free.minimal)
