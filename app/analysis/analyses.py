"""Analyse a PGN file or a recorded game, and write what was found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from app import UserError
from app.analysis.evaluating import AnalysisSettings, analysis_engine, evaluate_game
from app.analysis.files import AnalysisFiles, files_in, write_analyses
from app.analysis.game_analysis import AnalysedGame, analysis_of
from app.analysis.model import Analyses, GameAnalysis
from app.analysis.sources import game_of_record, games_of_pgn
from app.players.game_end import plies_in_words
from app.records.files import check_folder
from app.records.rounds import match_folder, rounds_of
from engine.stockfish import Engine


@dataclass(frozen=True, slots=True)
class AnalysesMade:
    """What was found, and the files that hold it."""

    analyses: Analyses
    files: tuple[Path, ...]


def analyse_games(
    path: Path, settings: AnalysisSettings, out: Path | None, told: Callable[[str], None]
) -> AnalysesMade:
    """Analyse all games of a PGN file, a recorded game, or all games of a match.

    Args:
        path: a file, or a folder.
        settings: how each position is searched.
        out: folder for the files; None: where the game lies.
        told: sentences about how far it is.

    Raises:
        UserError: there is no game, or the files cannot be written.
        EngineProblem: the engine is missing, or fails.
    """
    batches = (
        _of_folder(path, out, told)
        if path.is_dir()
        else ((files_in(out or path.parent, path.stem), games_of_pgn(path, told)),)
    )
    for folder in {files.json.parent for files, _ in batches}:
        check_folder(folder)
    found, written = list[GameAnalysis](), list[Path]()
    count = sum(len(games) for _, games in batches)
    with analysis_engine(settings) as engine:
        for files, games in batches:
            pairs = []
            for game in games:
                number = len(found) + 1
                told(f"game {number} of {count}: {game.white} - {game.black}, {plies_in_words(len(game.moves))}")
                found.append(_analyse(engine, settings, game))
                pairs.append((game, found[-1]))
            write_analyses(files, pairs)
            written += files
    return AnalysesMade(Analyses(games=tuple(found)), tuple(written))


def _of_folder(
    folder: Path, out: Path | None, told: Callable[[str], None]
) -> Sequence[tuple[AnalysisFiles, Sequence[AnalysedGame]]]:
    """Each game of a match lies in a folder of its own."""
    rounds = rounds_of(folder) if match_folder(folder) == folder.resolve() else ()
    batches = []
    for one in rounds or (folder,):
        game = game_of_record(one, told)
        if game is not None:
            target = one if out is None else out
            stem = None if out is None else one.resolve().name
            batches.append((files_in(target, stem), (game,)))
    if not batches:
        raise UserError(f"{folder} holds no game with a move: name a PGN file or the folder of a recorded game")
    return batches


def _analyse(engine: Engine, settings: AnalysisSettings, game: AnalysedGame) -> GameAnalysis:
    evaluations = evaluate_game(engine, settings, game.board, game.moves)
    return analysis_of(game, evaluations, engine.name or "an engine without a name", settings)
