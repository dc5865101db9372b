"""Texts in the language of a session, by the LocaleIds with which it was activated (Part 4, 5.4, 5.7.3)."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from asyncua import ua

ENGLISH: Final = "en"
"""Language that texts are written in."""


class TranslatedText(ua.LocalizedText):  # type: ignore[misc]
    """An English text that is made anew each time, together with its translation."""

    def __init__(self, english: str, **translations: str) -> None:
        super().__init__(english, ENGLISH)
        object.__setattr__(self, "translations", translations)


class Languages:
    """The languages that a server speaks.

    Parameters
    ----------
    translations : mapping
        Of each language but English, its texts by the English ones.
    """

    def __init__(self, translations: Mapping[str, Mapping[str, str]]) -> None:
        self._translations = translations

    @property
    def locale_ids(self) -> list[str]:
        """Every language, as LocaleIdArray shows them."""
        return [ENGLISH, *self._translations]

    def choose(self, locale_ids: Sequence[str | None] | None) -> str | None:
        """Choose the first language that is spoken, whatever the country; None where there is none."""
        for locale_id in locale_ids or ():
            language = (locale_id or "").partition("-")[0].lower()
            if language in self.locale_ids:
                return language
        return None

    def text(self, text: ua.LocalizedText, language: str | None) -> ua.LocalizedText:
        """Give a text in a language: as it is where it is not known, or nothing is asked."""
        if language is None or not text.Text:
            return text
        of_its_own = getattr(text, "translations", None)
        if language == ENGLISH:
            known = of_its_own is not None or any(text.Text in texts for texts in self._translations.values())
            return ua.LocalizedText(text.Text, ENGLISH) if known else text
        translated = (of_its_own or self._translations[language]).get(language if of_its_own else text.Text)
        return ua.LocalizedText(translated, language) if translated else text

    def variant(self, variant: Any, language: str | None) -> Any:
        """Give a value with its texts in a language."""
        if language is None or variant is None or variant.VariantType != ua.VariantType.LocalizedText:
            return variant
        value = variant.Value
        if isinstance(value, ua.LocalizedText):
            return ua.Variant(self.text(value, language), variant.VariantType)
        if not isinstance(value, list):
            return variant
        texts = [self.text(text, language) if isinstance(text, ua.LocalizedText) else text for text in value]
        return ua.Variant(texts, variant.VariantType, variant.Dimensions, variant.is_array)

    def data(self, data: ua.DataValue, language: str | None) -> ua.DataValue:
        """Give a DataValue with its texts in a language."""
        variant = self.variant(data.Value, language)
        if variant is data.Value:
            return data
        return ua.DataValue(variant, data.StatusCode, data.SourceTimestamp, data.ServerTimestamp)
