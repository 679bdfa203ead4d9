"""The tree of topological maps, against an enumeration of all of them."""

from __future__ import annotations

from itertools import product

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from albot_core.mappers.hssh.map_tree import OPEN, MapTree, Travel, TreeConfig, Visit
from albot_core.mappers.hssh.star import ENDS, Star, alignments

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
            found.add(visits)
    return found


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
    assert [tuple(visit) for visit in tree.best.visits] == [(0, 0), (1, 0), (0, 0)]
    assert len(tree.maps) == 1


def test_a_wrong_perception_is_repaired_and_counted():
    tree = grown(TEE, [Travel(0, END, 0), Travel(0, CROSS, 2)])
    assert tree.contradictions == 1
    assert tree.best.visits[-1].place == 2
    assert tree.best.joined[0][0] == OPEN


def test_evidence_besides_the_stars_prunes():
    tree = MapTree(BEND)
    seen = []

    def judge(first: int, shift: int) -> bool:
        seen.append((first, shift))
        return False

    for _ in range(4):
        tree.travel(Travel(1, BEND, 0), judge)
    assert [each.places for each in tree.maps] == [5]
    assert (0, 0) in seen


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


def test_visits_that_fit_no_travel_are_refused():
    with pytest.raises(InputError, match="map 0: expected visits that fit the travels"):
        MapTree.replayed(TEE, [Travel(0, CROSS, 0)], [[Visit(0, 0), Visit(0, 0)]])


@pytest.mark.parametrize(("left", "arrived"), [(3, 0), (0, 4), (-1, 0)])
def test_a_gateway_that_is_not_there_is_refused(left, arrived):
    with pytest.raises(InputError, match="Travel, "):
        MapTree(TEE).travel(Travel(left, CROSS, arrived))


def test_stars_of_one_shape():
    assert TEE.turned(1) == Star(2, ENDS, 0)
    assert TEE.turned(1).kind == TEE.turned(2).kind == TEE.kind
    assert alignments(CROSS, CROSS) == (0, 1, 2, 3)
    assert alignments(TEE.turned(1), TEE) == (1,)
    assert alignments(Star(), Star()) == (0,)
    assert [star.paths for star in STARS] == [1, 2, 1, 2, 3, 2]
    with pytest.raises(InputError, match="Star, gateway 0"):
        Star(0)
